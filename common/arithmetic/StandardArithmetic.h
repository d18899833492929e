// The floating-point environment of a new process, for the calling thread while this object lives: results
// are rounded to the nearest, subnormal numbers count and nothing traps, whatever the host program has set.
// Modes set by libraries loaded meanwhile, such as those that GCC links with -Ofast, end with it.
#pragma once

#include <cfenv>

#ifdef __x86_64__
#include <xmmintrin.h>
#endif

namespace common {

class StandardArithmetic {
 public:
  StandardArithmetic() noexcept : was_standard_(is_standard()) {
    if (was_standard_) return;
    std::fegetenv(&before_);
    std::fesetenv(FE_DFL_ENV);
  }
  ~StandardArithmetic() {
    if (!was_standard_)
      std::fesetenv(&before_);
    else if (!is_standard())
      std::fesetenv(FE_DFL_ENV);
  }
  StandardArithmetic(const StandardArithmetic&) = delete;
  StandardArithmetic& operator=(const StandardArithmetic&) = delete;

 private:
  // Reading takes a hundredth of the time of writing.
  static bool is_standard() noexcept {
#ifdef __x86_64__
    constexpr unsigned kControl = 0xffc0, kStandard = 0x1f80;  // of MXCSR: exceptions masked, nothing else
    return (_mm_getcsr() & kControl) == kStandard && std::fegetround() == FE_TONEAREST;
#else
    return false;
#endif
  }

  bool was_standard_;
  std::fenv_t before_;
};

}  // namespace common
