// patina: adds generated detail to the material of an existing 3D asset. What is only for a process of its
// own stands here: its streams, its threads' patience and its signals; program.h has the rest.
#include <fcntl.h>
#include <unistd.h>

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

#if defined(__AVX2__) && defined(__GNUC__)
// Runs before anything of patina's that may use AVX2, and without it.
[[gnu::constructor(101), gnu::target("arch=x86-64")]] void refuse_older_processors() {
  __builtin_cpu_init();
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") && __builtin_cpu_supports("bmi2"))
    return;
  static const char text[] =
      "patina: this processor has no AVX2, which Intel's have since 2013 and AMD's since 2015; use another "
      "machine, or build patina with -DPATINA_ARCH=x86-64\n";
  (void)!::write(STDERR_FILENO, text, sizeof text - 1);
  ::_exit(1);
}
#endif

}  // namespace

int main(int argc, char** argv) {
  open_standard_streams();
  // Only these commands run networks; the others start twice as fast without it.
  const std::string_view command = argc > 1 ? argv[1] : "";
  if (command == "enhance" || command == "batch" || command == "detail" || command == "ablate" ||
      command == "show-attention")
    patina::app::sleep_between_parallel_regions(argv);
  patina::app::install_signal_handlers();
  patina::app::say_why_when_terminated();
  return patina::app::run_program(argc, argv);
}
