#include "patina/base/progress.h"

#include "patina/base/error.h"

namespace patina {

void Progress::throw_if_stopped() const {
  if (stop_requested && stop_requested())
    throw Error(ErrorCode::kInterrupted, "", "stopped; the same command goes on from here");
}

}  // namespace patina
