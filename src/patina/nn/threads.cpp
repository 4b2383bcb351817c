#include "patina/nn/threads.h"

#include <ATen/Parallel.h>

#include "patina/base/parallel.h"

namespace patina::nn {

void set_num_threads(int num_threads) {
  patina::set_num_threads(num_threads);
  at::set_num_threads(patina::num_threads());
}

int num_network_threads() {
  return at::get_num_threads();
}

void set_num_network_threads(int num_threads) {
  at::set_num_threads(num_threads);
}

}  // namespace patina::nn
