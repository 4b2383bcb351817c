// patina: adds generated detail to the material of an existing 3D asset. What is only for a process of its
// own stands here: its streams, its threads' patience and its signals; program.h has the rest.
#include <fcntl.h>

#include <string_view>

#include "console.h"
#include "program.h"
#include "wait_policy.h"

namespace {

// A program that is started with a closed standard stream would open its first file in that stream's place.
void open_standard_streams() {
  for (int fd = 0; fd < 3; ++fd)
    if (::fcntl(fd, F_GETFD) == -1) (void)::open("/dev/null", fd == 0 ? O_RDONLY : O_WRONLY);
}

}  // namespace

int main(int argc, char** argv) {
  open_standard_streams();
  // Only these commands run networks; the others start twice as fast without it.
  const std::string_view command = argc > 1 ? argv[1] : "";
  if (command == "enhance" || command == "detail" || command == "ablate" || command == "show-attention")
    patina::app::sleep_between_parallel_regions(argv);
  patina::app::install_signal_handlers();
  patina::app::say_why_when_terminated();
  return patina::app::run_program(argc, argv);
}
