#include "workers.h"

#include <algorithm>
#include <exception>
#include <thread>
#include <vector>

#include <ATen/Parallel.h>

namespace patina::train_mini {

int64_t default_workers(c10::Device device) {
  if (!device.is_cpu()) return 1;
  return std::clamp<int64_t>(std::thread::hardware_concurrency(), 1, 2);
}

void in_shares(int64_t workers, int64_t count, const std::function<void(int64_t begin, int64_t end)>& share) {
  workers = std::clamp<int64_t>(workers, 1, count);
  if (workers == 1) return share(0, count);
  std::vector<std::exception_ptr> thrown(static_cast<size_t>(workers));
  std::vector<std::thread> threads;
  for (int64_t i = 0; i < workers; ++i) {
    threads.emplace_back([&, i] {
      at::set_num_threads(1);
      try {
        share(i * count / workers, (i + 1) * count / workers);
      } catch (...) {
        thrown[static_cast<size_t>(i)] = std::current_exception();
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  for (const std::exception_ptr& error : thrown)
    if (error) std::rethrow_exception(error);
}

}  // namespace patina::train_mini
