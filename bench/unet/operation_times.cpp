#include "operation_times.h"

#include <chrono>
#include <memory>

#include <ATen/record_function.h>

namespace patina::bench {
namespace {

using Clock = std::chrono::steady_clock;

struct Open : at::ObserverContext {
  Clock::time_point since;
};

thread_local int depth = 0;
std::map<std::string, double>* sums = nullptr;

std::unique_ptr<at::ObserverContext> begin(const at::RecordFunction&) {
  if (depth++ > 0) return nullptr;
  auto open = std::make_unique<Open>();
  open->since = Clock::now();
  return open;
}

void end(const at::RecordFunction& function, at::ObserverContext* context) {
  --depth;
  if (!context) return;
  const std::chrono::duration<double> taken = Clock::now() - static_cast<Open*>(context)->since;
  (*sums)[function.name()] += taken.count();
}

}  // namespace

std::map<std::string, double> operation_seconds(const std::function<void()>& work) {
  std::map<std::string, double> seconds;
  sums = &seconds;
  const auto handle =
      at::addThreadLocalCallback(at::RecordFunctionCallback(begin, end).scopes({at::RecordScope::FUNCTION}));
  work();
  at::removeCallback(handle);
  sums = nullptr;
  return seconds;
}

}  // namespace patina::bench
