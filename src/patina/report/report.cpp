#include "patina/report/report.h"
