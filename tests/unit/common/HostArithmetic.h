// The arithmetic of a host program that has changed it, while this object lives: results are rounded up and,
// on x86-64, subnormal numbers are 0.
#pragma once

#include <cfenv>

#ifdef __x86_64__
#include <xmmintrin.h>
#endif

namespace common {

class HostArithmetic {
 public:
  HostArithmetic() {
    std::fegetenv(&before_);
    std::fesetround(FE_UPWARD);
#ifdef __x86_64__
    _mm_setcsr(_mm_getcsr() | kFlushes);
#endif
  }
  ~HostArithmetic() { std::fesetenv(&before_); }
  HostArithmetic(const HostArithmetic&) = delete;
  HostArithmetic& operator=(const HostArithmetic&) = delete;

  static bool is_set() {
#ifdef __x86_64__
    if ((_mm_getcsr() & kFlushes) != kFlushes) return false;
#endif
    return std::fegetround() == FE_UPWARD;
  }

 private:
  static constexpr unsigned kFlushes = 0x8040;  // to and of subnormal numbers
  std::fenv_t before_;
};

}  // namespace common
