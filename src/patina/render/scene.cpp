#include "patina/render/scene.h"
