// The locale "C" for the calling thread while this object lives: numbers have a point, and texts compare by
// their bytes, whatever locale the host program has set.
#pragma once

#include <locale.h>

namespace common {

class ClassicLocale {
 public:
  ClassicLocale() noexcept : before_(::uselocale(classic())) {}
  ~ClassicLocale() { ::uselocale(before_); }
  ClassicLocale(const ClassicLocale&) = delete;
  ClassicLocale& operator=(const ClassicLocale&) = delete;

 private:
  static locale_t classic() noexcept {
    static const locale_t locale = ::newlocale(LC_ALL_MASK, "C", locale_t{});
    return locale;
  }
  locale_t before_;
};

}  // namespace common
