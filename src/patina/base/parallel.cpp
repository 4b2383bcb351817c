#include "patina/base/parallel.h"

#include <memory>
#include <mutex>

#include <tbb/blocked_range.h>
#include <tbb/global_control.h>
#include <tbb/info.h>
#include <tbb/parallel_for.h>

namespace patina {
namespace {

// oneTBB keeps its limit as long as the control object lives; the mutex lets two threads set it safely.
struct ThreadLimit {
  std::mutex mutex;
  std::unique_ptr<tbb::global_control> control;
};

ThreadLimit& thread_limit() {
  static ThreadLimit limit;
  return limit;
}

}  // namespace

void parallel_for(int64_t begin, int64_t end, int64_t grain,
                  const std::function<void(int64_t, int64_t)>& body) {
  if (begin >= end) return;
  tbb::parallel_for(tbb::blocked_range<int64_t>(begin, end, static_cast<size_t>(grain > 0 ? grain : 1)),
                    [&](const tbb::blocked_range<int64_t>& range) { body(range.begin(), range.end()); });
}

void set_num_threads(int num_threads) {
  ThreadLimit& limit = thread_limit();
  const std::lock_guard lock(limit.mutex);
  limit.control.reset();
  if (num_threads > 0)
    limit.control = std::make_unique<tbb::global_control>(tbb::global_control::max_allowed_parallelism,
                                                          static_cast<size_t>(num_threads));
}

int num_threads() {
  return static_cast<int>(
      std::min<size_t>(static_cast<size_t>(tbb::info::default_concurrency()),
                       tbb::global_control::active_value(tbb::global_control::max_allowed_parallelism)));
}

}  // namespace patina
