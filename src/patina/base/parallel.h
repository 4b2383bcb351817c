// Loops over threads, on oneTBB. Results never depend on how a loop was cut.
#pragma once

#include <cstdint>
#include <functional>

namespace patina {

/// Calls body(begin, end) over disjoint ranges that cover [begin, end), each at least `grain` long where
/// possible. The first exception of a body is rethrown here once all running bodies have ended.
void parallel_for(int64_t begin, int64_t end, int64_t grain,
                  const std::function<void(int64_t, int64_t)>& body);

/// Number of threads that parallel_for uses; 0 sets it back to all processors. Affects the whole process.
void set_num_threads(int num_threads);
int num_threads();

}  // namespace patina
