#include "emulated_gpu/emulated_gpu.h"

#include <ucontext.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <functional>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>

#include "patina/attention/cuda/merge_block.h"
#include "patina/base/bf16.h"

namespace patina::attention::test {
namespace {

using namespace patina::attention::cuda;

[[noreturn]] void misuse(const std::string& what) {
  throw std::logic_error("emulated GPU: " + what);
}

float to_float(Element16 element, uint16_t bits) {
  return element == Element16::kBf16 ? float_of_bf16(bits) : float_of_half(bits);
}
uint16_t to_16(Element16 element, float value) {
  return element == Element16::kBf16 ? bf16_of_float(value) : half_of_float(value);
}

/// What a thread asks of its warp, and gets.
enum class Op { kNone, kDone, kBarrier, kShuffle, kAny, kLoad, kLoadTransposed, kMultiply16, kMultiply8 };
struct Request {
  Op op = Op::kNone;
  uint32_t value = 0;  // shuffled or voted; an address
  int source = 0;      // of a shuffle
  std::array<uint32_t, 4> a{};
  std::array<uint32_t, 2> b{};
  std::array<float, 4> c{};
};

struct Copy {
  uint32_t to;
  const void* from;
  bool exists;
};

class Block;

/// The `Gpu` of merge_block, for one thread.
class Thread {
 public:
  Thread(Block& block, int index) : block_(block), index_(index) {}

  int thread() const { return index_; }
  void barrier() { collect(Op::kBarrier); }
  uint32_t shuffle(uint32_t value, int source) {
    request.value = value;
    request.source = source;
    collect(Op::kShuffle);
    return request.value;
  }
  float exchange(float value, int distance) {
    return std::bit_cast<float>(shuffle(std::bit_cast<uint32_t>(value), index_ % 32 ^ distance));
  }
  bool any(bool condition) {
    request.value = condition;
    collect(Op::kAny);
    return request.value != 0;
  }
  void load_matrices(uint32_t (&out)[4], uint32_t address) { load(Op::kLoad, out, address); }
  void load_transposed(uint32_t (&out)[4], uint32_t address) { load(Op::kLoadTransposed, out, address); }
  void multiply16(float (&c)[4], const uint32_t (&a)[4], uint32_t b0, uint32_t b1) {
    std::copy(a, a + 4, request.a.begin());
    request.b = {b0, b1};
    multiply(Op::kMultiply16, c);
  }
  void multiply8(float (&c)[4], uint32_t a0, uint32_t a1, uint32_t b0) {
    request.a = {a0, a1, 0, 0};
    request.b = {b0, 0};
    multiply(Op::kMultiply8, c);
  }

  void copy16(uint32_t to, const void* from, bool exists);
  void commit_copies() { groups_.emplace_back(std::move(open_)), open_.clear(); }
  template <int kPending>
  void wait_copies() {
    while (groups_.size() > kPending) {
      for (const Copy& copy : groups_.front()) arrive(copy);
      groups_.erase(groups_.begin());
    }
  }

  void load_pair(const uint16_t* from, float (&two)[2]) const;
  void store_pair(uint16_t* to, float first, float second) const;
  uint32_t pack(float first, float second) const;
  static float exp2(float x) { return std::exp2(x); }
  static float log2(float x) { return std::log2(x); }
  static float max(float x, float y) { return std::fmax(x, y); }
  static float multiply_add(float x, float y, float z) { return std::fma(x, y, z); }
  static float infinity() { return std::numeric_limits<float>::infinity(); }

  Request request;
  ucontext_t context{};

 private:
  void collect(Op op);
  void load(Op op, uint32_t (&out)[4], uint32_t address) {
    request.value = address;
    collect(op);
    std::copy(request.a.begin(), request.a.end(), out);
  }
  void multiply(Op op, float (&c)[4]) {
    std::copy(c, c + 4, request.c.begin());
    collect(op);
    std::copy(request.c.begin(), request.c.end(), c);
  }
  void arrive(const Copy& copy);

  Block& block_;
  int index_;
  std::vector<Copy> open_;
  std::vector<std::vector<Copy>> groups_;
};

/// One thread block: its fibers, its shared memory, and what a warp does together.
class Block {
 public:
  Block(const SparseMerge& of, const Extents& inside, const Schedule& by)
      : merge(of), extents(inside), schedule(by), stacks_(size_t{kThreads} * kStackBytes) {}

  /// Runs `body` in every thread, on `shared_bytes` of shared memory that hold NaN at first.
  void run(const std::function<void(Thread&)>& body, int shared_bytes) {
    shared.assign(static_cast<size_t>(shared_bytes) / 2, uint16_t{0x7fff});
    body_ = &body;
    threads_.clear();
    for (int t = 0; t < kThreads; ++t) threads_.emplace_back(*this, t);
    for (int t = 0; t < kThreads; ++t) {
      ucontext_t& context = threads_[static_cast<size_t>(t)].context;
      getcontext(&context);
      context.uc_stack.ss_sp = stacks_.data() + size_t{kStackBytes} * static_cast<size_t>(t);
      context.uc_stack.ss_size = kStackBytes;
      context.uc_link = &scheduler_;
      const uintptr_t self = reinterpret_cast<uintptr_t>(this);
      makecontext(&context, reinterpret_cast<void (*)()>(&Block::enter), 3, static_cast<unsigned>(self >> 32),
                  static_cast<unsigned>(self), t);
    }
    bool done = false;
    while (!done) {
      for (int i = 0; i < kWarps; ++i) run_to_barrier(schedule.last_warp_first ? kWarps - 1 - i : i);
      const Op op = threads_[0].request.op;
      for (const Thread& thread : threads_)
        if (thread.request.op != op) misuse("some warps wait at a barrier that others do not come to");
      done = op == Op::kDone;
    }
  }

  void yield(Thread& thread) { swapcontext(&thread.context, &scheduler_); }

  const SparseMerge& merge;
  const Extents& extents;
  const Schedule& schedule;
  std::vector<uint16_t> shared;
  int64_t conflicts = 0, multiplications = 0;

 private:
  static constexpr size_t kStackBytes = 64 << 10;

  static void enter(unsigned high, unsigned low, int thread) {
    Block* block = reinterpret_cast<Block*>(static_cast<uintptr_t>(high) << 32 | low);
    Thread& self = block->threads_[static_cast<size_t>(thread)];
    try {
      (*block->body_)(self);
    } catch (...) {
      block->error_ = std::current_exception();  // an exception cannot leave a fiber
    }
    self.request.op = Op::kDone;
  }

  /// Runs a warp until all its threads are at a barrier or done.
  void run_to_barrier(int warp) {
    Thread* threads = threads_.data() + warp * 32;
    for (;;) {
      for (int t = 0; t < 32; ++t) {
        if (threads[t].request.op == Op::kDone) continue;
        swapcontext(&scheduler_, &threads[t].context);
        if (error_) std::rethrow_exception(std::exchange(error_, nullptr));
      }
      const Op op = threads[0].request.op;
      for (int t = 1; t < 32; ++t)
        if (threads[t].request.op != op) misuse("threads of one warp are at different instructions");
      if (op == Op::kDone || op == Op::kBarrier) return;
      execute(op, threads);
    }
  }

  void execute(Op op, Thread* threads) {
    switch (op) {
      case Op::kShuffle: {
        std::array<uint32_t, 32> values;
        for (size_t t = 0; t < 32; ++t) values[t] = threads[t].request.value;
        for (size_t t = 0; t < 32; ++t)
          threads[t].request.value = values.at(static_cast<size_t>(threads[t].request.source));
        break;
      }
      case Op::kAny: {
        bool any = false;
        for (int t = 0; t < 32; ++t) any |= threads[t].request.value != 0;
        for (int t = 0; t < 32; ++t) threads[t].request.value = any;
        break;
      }
      case Op::kLoad:
      case Op::kLoadTransposed:
        load(threads, op == Op::kLoadTransposed);
        break;
      case Op::kMultiply16:
        multiply(threads, 16);
        break;
      case Op::kMultiply8:
        multiply(threads, 8);
        break;
      default:
        misuse("no such instruction");
    }
  }

  /// ldmatrix .x4: thread 8m + i names row i of matrix m; thread t gets of each matrix the elements
  /// 2 (t%4), +1 of row t/4, or, transposed, of column t/4.
  void load(Thread* threads, bool transposed) {
    std::array<uint32_t, 32> address;
    for (size_t t = 0; t < 32; ++t) {
      address[t] = threads[t].request.value;
      if (address[t] % 16 != 0) misuse("matrix row at " + std::to_string(address[t]) + ", not on 16 bytes");
      if (address[t] + 16 > shared.size() * 2) misuse("matrix row beyond shared memory");
    }
    for (size_t m = 0; m < 4; ++m) {
      unsigned banks = 0;  // of 16 bytes; eight rows must fall on eight
      for (size_t i = 0; i < 8; ++i) banks |= 1u << address[8 * m + i] / 16 % 8;
      conflicts += banks != 0xff;
      const auto element = [&](size_t row, size_t column) -> uint32_t {
        return transposed ? shared[address[8 * m + column] / 2 + row]
                          : shared[address[8 * m + row] / 2 + column];
      };
      for (size_t t = 0; t < 32; ++t)
        threads[t].request.a[m] = element(t / 4, t % 4 * 2) | element(t / 4, t % 4 * 2 + 1) << 16;
    }
  }

  /// mma .m16n8k16 or .m16n8k8, f32 accumulators.
  void multiply(Thread* threads, size_t depth) {
    const auto half = [&](uint32_t pair, size_t which) {
      return to_float(merge.element, static_cast<uint16_t>(pair >> 16 * which));
    };
    float a[16][16] = {}, b[16][8] = {};
    for (size_t t = 0; t < 32; ++t)
      for (size_t e = 0; e < 2; ++e) {
        const size_t row = t / 4, column = t % 4 * 2 + e;
        const Request& request = threads[t].request;
        for (size_t i = 0; i < depth / 4; ++i) a[row + i % 2 * 8][column + i / 2 * 8] = half(request.a[i], e);
        for (size_t i = 0; i < depth / 8; ++i) b[column + i * 8][row] = half(request.b[i], e);
      }
    for (size_t t = 0; t < 32; ++t)
      for (size_t i = 0; i < 4; ++i) {
        float sum = 0;
        for (size_t k = 0; k < depth; ++k) sum += a[t / 4 + i / 2 * 8][k] * b[k][t % 4 * 2 + i % 2];
        threads[t].request.c[i] += sum;
      }
    ++multiplications;
  }

  std::vector<Thread> threads_;
  std::vector<char> stacks_;
  ucontext_t scheduler_{};
  const std::function<void(Thread&)>* body_ = nullptr;
  std::exception_ptr error_;
};

void Thread::collect(Op op) {
  request.op = op;
  block_.yield(*this);
}

void Thread::copy16(uint32_t to, const void* from, bool exists) {
  if (to % 16 != 0 || to + 16 > block_.shared.size() * 2)
    misuse("copy to " + std::to_string(to) + " of shared memory");
  if (exists) {
    if (reinterpret_cast<uintptr_t>(from) % 16 != 0) misuse("copy from an address not on 16 bytes");
    const auto inside = [&](const void* tensor, int64_t size) {
      const uintptr_t begin = reinterpret_cast<uintptr_t>(tensor), at = reinterpret_cast<uintptr_t>(from);
      return at >= begin && at + 16 <= begin + static_cast<uintptr_t>(size) * 2;
    };
    if (!inside(block_.merge.q, block_.extents.q_size) && !inside(block_.merge.k, block_.extents.k_size) &&
        !inside(block_.merge.v, block_.extents.v_size))
      misuse("copy from outside the tensors");
  }
  if (block_.schedule.copies_arrive_late)
    open_.push_back({to, from, exists});
  else
    arrive({to, from, exists});
}

void Thread::arrive(const Copy& copy) {
  uint16_t* to = block_.shared.data() + copy.to / 2;
  if (copy.exists)
    std::memcpy(to, copy.from, 16);
  else
    std::fill(to, to + 8, uint16_t{0});
}

void Thread::load_pair(const uint16_t* from, float (&two)[2]) const {
  for (int i = 0; i < 2; ++i) two[i] = to_float(block_.merge.element, from[i]);
}
void Thread::store_pair(uint16_t* to, float first, float second) const {
  to[0] = to_16(block_.merge.element, first);
  to[1] = to_16(block_.merge.element, second);
}
uint32_t Thread::pack(float first, float second) const {
  return to_16(block_.merge.element, first) | uint32_t{to_16(block_.merge.element, second)} << 16;
}

template <int kPieces>
void emulate(Block& block) {
  const SparseMerge& merge = block.merge;
  const MergeConstants constants = merge_constants(merge.scale, merge.beta);
  for (int batch = 0; batch < merge.shape.batch; ++batch)
    for (int head = 0; head < merge.shape.num_heads; ++head)
      for (int index = 0; index < merge.num_blocks; ++index)
        block.run([&](Thread& thread) { merge_block<kPieces>(thread, merge, constants, index, head, batch); },
                  SharedLayout<kPieces>::kBytes);
}

}  // namespace

uint16_t half_of_float(float value) {
  const uint16_t sign = std::signbit(value) ? 0x8000 : 0;
  const float magnitude = std::abs(value);
  if (std::isnan(value)) return sign | 0x7e00;
  if (magnitude >= 65520) return sign | 0x7c00;
  if (magnitude == 0) return sign;
  const int exponent = std::max(std::ilogb(magnitude), -14);
  const int steps = static_cast<int>(std::nearbyint(std::ldexp(magnitude, 10 - exponent)));
  // A subnormal has no implied leading one; a magnitude that was rounded up to 2048 steps carries.
  return static_cast<uint16_t>(sign | (((exponent + 14) << 10) + steps));
}

float float_of_half(uint16_t half) {
  const float sign = half & 0x8000 ? -1.0f : 1.0f;
  const int exponent = half >> 10 & 31, steps = half & 1023;
  if (exponent == 31) return steps ? std::numeric_limits<float>::quiet_NaN() : sign * INFINITY;
  if (exponent == 0) return sign * std::ldexp(static_cast<float>(steps), -24);
  return sign * std::ldexp(static_cast<float>(1024 + steps), exponent - 25);
}

EmulationReport emulate_sparse_merge(const SparseMerge& merge, const Extents& extents,
                                     const Schedule& schedule) {
  validate(merge);
  Block block(merge, extents, schedule);
  dispatch_pieces(merge.shape.head_dim, [&]<int kPieces>() { emulate<kPieces>(block); });
  return {block.conflicts, block.multiplications};
}

}  // namespace patina::attention::test
