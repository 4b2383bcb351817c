// How the threads of LibTorch wait. No Torch here.
#pragma once

namespace patina::nn {

/// To be called first in main() of a program that runs networks: makes OpenMP's threads sleep between
/// parallel regions instead of spinning, unless the user has set OMP_WAIT_POLICY. OpenMP reads that before
/// main(), so the program is started again in place (once; same process id, same arguments). Spinning threads
/// take the processors away from the threads of the attention kernels and of other programs: one
/// image-to-image test of the small model takes 0.3 s with sleeping threads and 30 s with spinning ones on
/// two cores that compile something else meanwhile.
void sleep_between_parallel_regions(char** argv);

}  // namespace patina::nn
