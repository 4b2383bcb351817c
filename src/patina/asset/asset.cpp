#include "patina/asset/asset.h"
