// One step of training on several cores: each thread takes its share of the batch through a graph of its own.
#pragma once

#include <cstdint>
#include <functional>

#include <c10/core/Device.h>

namespace patina::train_mini {

/// Threads that share a step where a run does not say: two at most, since the sum of two gradients is the
/// same in either order and a training can be repeated to the bit; one on a GPU.
int64_t default_workers(c10::Device device);

/// Calls share(begin, end) for parts of [0, count) that differ by one in length at most, each on a thread of
/// its own that runs its operations alone. Gradients that the shares send back add up in the same leaves.
/// One operation of the small networks here is too short for two threads: this is 1.6 times as fast.
/// Throws what a share threw.
void in_shares(int64_t workers, int64_t count, const std::function<void(int64_t begin, int64_t end)>& share);

}  // namespace patina::train_mini
