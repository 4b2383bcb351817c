// The list of biased keys is shared with CUDA and lies one folder up.
#pragma once

#include "patina/attention/query_blocks.h"
