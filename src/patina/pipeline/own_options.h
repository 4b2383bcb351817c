// Options that are of no common kind: each is parsed and written in its own way.
#pragma once

#include <string>

#include "patina/pipeline/options.h"

namespace patina::pipeline {

Option elevations_option();
Option views_option();
Option resolution_option();
Option preset_option();
Option exposure_option();
Option materials_option();
Option negative_prompt_option(const std::string& group);
Option guidance_scale_option(const std::string& group);
Option texture_size_option();
Option fit_option();
Option loras_option(const std::string& group);

}  // namespace patina::pipeline
