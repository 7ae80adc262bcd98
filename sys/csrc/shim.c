/* Gives the inline functions of the header symbols that Rust can link to. In C they are plain `inline`, which
   emits none by itself; an `extern` declaration makes this unit emit it. */
#include "../wrapper.h"

extern inline void rtcInitRayQueryContext(struct RTCRayQueryContext *context);
extern inline void rtcInitPointQueryContext(struct RTCPointQueryContext *context);
extern inline void rtcInitIntersectArguments(struct RTCIntersectArguments *args);
extern inline void rtcInitOccludedArguments(struct RTCOccludedArguments *args);

const char *embree4_new_device_error(void)
{
#if RTC_VERSION >= 40303
  return rtcGetDeviceLastErrorMessage(NULL);
#else
  return NULL;
#endif
}
