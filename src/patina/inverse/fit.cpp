#include "patina/inverse/fit.h"
