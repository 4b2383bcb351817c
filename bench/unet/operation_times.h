// Where the time of a network goes, operation by operation of LibTorch.
#pragma once

#include <functional>
#include <map>
#include <string>

namespace patina::bench {

/// Seconds in every outermost operation that `work` calls on this thread, by its name ("aten::conv2d"). What
/// is no operation of LibTorch (attention, convolutions by Winograd) is in none.
std::map<std::string, double> operation_seconds(const std::function<void()>& work);

}  // namespace patina::bench
