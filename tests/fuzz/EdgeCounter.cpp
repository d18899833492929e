// Counts the edges that GCC's -fsanitize-coverage=trace-pc reports where libFuzzer, which takes Clang's own
// counters, finds them.
#include <cstddef>
#include <cstdint>

namespace {

constexpr std::size_t kCounters = std::size_t{1} << 16;
// libFuzzer reads, and clears before each input, what stands in this section.
[[gnu::section("__libfuzzer_extra_counters"), gnu::used]] std::uint8_t counters[kCounters];

}  // namespace

// The linker puts it in the place of __sanitizer_cov_trace_pc(), where libFuzzer refuses. An edge is told by
// the address after the call; shared counters lose little.
extern "C" void __wrap___sanitizer_cov_trace_pc() {
  const auto address = reinterpret_cast<std::uintptr_t>(__builtin_return_address(0));
  std::uint8_t& counter = counters[(address ^ (address >> 16U)) % kCounters];
  if (counter < UINT8_MAX) ++counter;
}

// Comparisons of integers go to libFuzzer itself, which knows none of floating-point numbers.
extern "C" void __sanitizer_cov_trace_cmpf(float, float) {}
extern "C" void __sanitizer_cov_trace_cmpd(double, double) {}
