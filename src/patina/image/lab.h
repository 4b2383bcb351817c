// CIELAB, in which equal distances look about equally different.
#pragma once

#include "patina/base/math.h"

namespace patina {

/// L*a*b* of linear Rec. 709 under D65 [CIE15]: L* in [0,100] for rgb in [0,1].
vec3 lab_from_linear(const vec3& rgb);

}  // namespace patina
