#include "patina/base/progress.h"

#include "patina/base/error.h"

namespace patina {

void Progress::throw_if_stopped() const {
  if (stop_requested && stop_requested())
    throw Error(ErrorCode::kInterrupted, "", "stopped at the user's request");
}

}  // namespace patina
