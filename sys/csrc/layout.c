/* The C compiler's own answer to "how big is it, how is it aligned, and where do its fields sit". */
#include <embree4/rtcore.h>
#include <stddef.h>

#define TYPE(T) \
  size_t embree4_size_##T(void) { return sizeof(struct T); } \
  size_t embree4_align_##T(void) { return _Alignof(struct T); }
#define AT(T, F) \
  size_t embree4_offset_##T##_##F(void) { return offsetof(struct T, F); }

#define RAY(T) \
  TYPE(T) AT(T, org_x) AT(T, org_y) AT(T, org_z) AT(T, tnear) AT(T, dir_x) AT(T, dir_y) AT(T, dir_z) \
  AT(T, time) AT(T, tfar) AT(T, mask) AT(T, id) AT(T, flags)
#define HIT(T) \
  TYPE(T) AT(T, Ng_x) AT(T, Ng_y) AT(T, Ng_z) AT(T, u) AT(T, v) AT(T, primID) AT(T, geomID) AT(T, instID) \
  AT(T, instPrimID)
#define RAY_HIT(T) TYPE(T) AT(T, ray) AT(T, hit)

RAY(RTCRay) RAY(RTCRay4) RAY(RTCRay8) RAY(RTCRay16)
HIT(RTCHit) HIT(RTCHit4) HIT(RTCHit8) HIT(RTCHit16)
RAY_HIT(RTCRayHit) RAY_HIT(RTCRayHit4) RAY_HIT(RTCRayHit8) RAY_HIT(RTCRayHit16)

TYPE(RTCBounds) AT(RTCBounds, lower_x) AT(RTCBounds, lower_y) AT(RTCBounds, lower_z)
AT(RTCBounds, upper_x) AT(RTCBounds, upper_y) AT(RTCBounds, upper_z)
TYPE(RTCLinearBounds) AT(RTCLinearBounds, bounds0) AT(RTCLinearBounds, bounds1)

TYPE(RTCRayQueryContext) AT(RTCRayQueryContext, instID) AT(RTCRayQueryContext, instPrimID)
TYPE(RTCPointQueryContext)
TYPE(RTCIntersectArguments) AT(RTCIntersectArguments, flags) AT(RTCIntersectArguments, feature_mask)
AT(RTCIntersectArguments, context) AT(RTCIntersectArguments, filter) AT(RTCIntersectArguments, intersect)
TYPE(RTCOccludedArguments) AT(RTCOccludedArguments, flags) AT(RTCOccludedArguments, feature_mask)
AT(RTCOccludedArguments, context) AT(RTCOccludedArguments, filter) AT(RTCOccludedArguments, occluded)

TYPE(RTCBoundsFunctionArguments) AT(RTCBoundsFunctionArguments, geometryUserPtr)
AT(RTCBoundsFunctionArguments, primID) AT(RTCBoundsFunctionArguments, bounds_o)
TYPE(RTCIntersectFunctionNArguments) AT(RTCIntersectFunctionNArguments, valid)
AT(RTCIntersectFunctionNArguments, geometryUserPtr) AT(RTCIntersectFunctionNArguments, primID)
AT(RTCIntersectFunctionNArguments, context) AT(RTCIntersectFunctionNArguments, rayhit)
AT(RTCIntersectFunctionNArguments, N) AT(RTCIntersectFunctionNArguments, geomID)
TYPE(RTCOccludedFunctionNArguments) AT(RTCOccludedFunctionNArguments, valid)
AT(RTCOccludedFunctionNArguments, geometryUserPtr) AT(RTCOccludedFunctionNArguments, primID)
AT(RTCOccludedFunctionNArguments, context) AT(RTCOccludedFunctionNArguments, ray)
AT(RTCOccludedFunctionNArguments, N) AT(RTCOccludedFunctionNArguments, geomID)
TYPE(RTCFilterFunctionNArguments) AT(RTCFilterFunctionNArguments, valid) AT(RTCFilterFunctionNArguments, N)

unsigned embree4_header_version(void) { return RTC_VERSION; }
