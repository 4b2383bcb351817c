#include "patina/correspond/noise.h"
