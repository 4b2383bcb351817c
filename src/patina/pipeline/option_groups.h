// One table a heading of --help. Each is a list of options with the field that the option fills.
#pragma once

#include <vector>

#include "patina/pipeline/options.h"

namespace patina::pipeline {

Option preset_option();
std::vector<Option> edit_options();
std::vector<Option> mask_options();
std::vector<Option> prior_options();
std::vector<Option> model_options();
std::vector<Option> input_output_options();
std::vector<Option> view_options();
std::vector<Option> fit_options();
std::vector<Option> machine_options();

}  // namespace patina::pipeline
