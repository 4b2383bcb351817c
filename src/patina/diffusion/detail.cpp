#include "patina/diffusion/detail.h"
