#include "patina/base/error.h"
