// The number of threads of both thread pools: oneTBB's (parallel_for) and LibTorch's. No Torch here.
#pragma once

namespace patina::nn {

/// Sets the threads of parallel_for and of LibTorch's operators; 0: all processors. Affects the whole
/// process, so that only a program calls it, once, before it runs networks; the library never does. A program
/// that does not call it keeps LibTorch's own choice, which may be fewer threads than there are processors.
void set_num_threads(int num_threads);

/// The threads of LibTorch's operators for the calling thread. LibTorch keeps the number for each thread that
/// calls it, so that a new thread takes over that of the one which started it.
int num_network_threads();
void set_num_network_threads(int num_threads);

}  // namespace patina::nn
