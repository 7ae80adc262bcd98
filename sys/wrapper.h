#include <embree4/rtcore.h>

/* Why rtcNewDevice has just failed on this thread; NULL before Embree 4.3.3, which cannot say. */
const char *embree4_new_device_error(void);
