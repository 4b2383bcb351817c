// How the tools beside the product tell a person how far they are.
#pragma once

#include "patina/base/progress.h"

namespace patina::tools {

/// One line on standard error that says how far a job is and how long the rest may take; warnings on lines of
/// their own.
Progress console_progress();

}  // namespace patina::tools
