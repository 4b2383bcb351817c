// Two built-in environments of daylight, made by formula. They are as unlike the studio as daylight gets:
// light from all sides, and nearly all light from one side.
#pragma once

#include "patina/render/environment.h"

namespace patina::render {

/// An overcast sky over grey ground.
Environment overcast_environment();
/// A low warm sun at the left of a viewer at +Z, under a clear sky.
Environment low_sun_environment();

}  // namespace patina::render
