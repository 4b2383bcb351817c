#include "patina/views/view_set.h"
