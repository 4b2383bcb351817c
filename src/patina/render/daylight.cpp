#include "patina/render/daylight.h"

namespace patina::render {

Environment overcast_environment() {
  return environment_of([](const vec3& direction) {
    // An overcast sky is a third as bright at the horizon as at the zenith; the ground is darker still.
    const vec3 sky = vec3(0.94f, 0.98f, 1.04f) * (1.0f + 2.0f * std::max(direction.y, 0.0f)) / 3.0f;
    return glm::mix(vec3(0.16f, 0.155f, 0.145f), sky, glm::smoothstep(-0.03f, 0.03f, direction.y));
  });
}

Environment low_sun_environment() {
  // The sun is drawn larger than it is, 12 degrees across, so that few samples render its light cleanly.
  const vec3 sun = glm::normalize(vec3(-0.736f, 0.276f, 0.618f));  // 50 degrees to the left, 16 up
  const float inside = std::cos(glm::radians(5.0f)), outside = std::cos(glm::radians(7.0f));
  return environment_of([=](const vec3& direction) {
    const float height = std::max(direction.y, 0.0f), toward = glm::dot(direction, sun);
    vec3 light = glm::mix(vec3(0.42f, 0.40f, 0.40f), vec3(0.16f, 0.24f, 0.42f), std::sqrt(height));
    light += vec3(0.9f, 0.5f, 0.22f) * std::pow(std::max(toward, 0.0f), 12.0f);  // haze about the sun
    light = glm::mix(vec3(0.11f, 0.09f, 0.075f), light, glm::smoothstep(-0.03f, 0.03f, direction.y));
    return light + vec3(110.0f, 72.0f, 40.0f) * glm::smoothstep(outside, inside, toward);
  });
}

}  // namespace patina::render
