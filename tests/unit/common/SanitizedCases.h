// How much a test tries under a sanitizer: the preset ci tries all of it.
#pragma once

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
inline constexpr bool kIsSanitized = true;
#else
inline constexpr bool kIsSanitized = false;
#endif

// The number of cases: all of them, or those under a sanitizer.
template <class Number>
constexpr Number cases(Number all, Number sanitized) {
  return kIsSanitized ? sanitized : all;
}
