#include "patina/attention/attention.h"
