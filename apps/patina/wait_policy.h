// How OpenMP's threads, which run LibTorch's operators, wait for work.
#pragma once

namespace patina::app {

/// To be called first in main(). Makes OpenMP's threads sleep between parallel regions instead of spinning,
/// unless the user has set OMP_WAIT_POLICY. OpenMP reads that variable before main(), so the program is
/// started again in place: once, with the same process id and arguments. Spinning threads take the processors
/// from the attention kernels and from other programs: an edit with the small model takes 0.3 s with sleeping
/// threads and 30 s with spinning ones, on two cores that compile something else meanwhile.
void sleep_between_parallel_regions(char** argv);

}  // namespace patina::app
