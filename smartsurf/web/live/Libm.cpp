// Functions of floats that round as those of glibc, so that the states are those of the programs. Those of
// emscripten's library round otherwise in the last bit. Sine and cosine are glibc's own, from newlib
// (cmake/Web.cmake).
#include <cmath>
#include <limits>

extern "C" {

float hypotf(float x, float y) {
  if (std::isinf(x) || std::isinf(y)) return std::numeric_limits<float>::infinity();
  return static_cast<float>(std::sqrt(static_cast<double>(x) * x + static_cast<double>(y) * y));
}

// The sine and cosine of an infinity.
float __math_invalidf(float) { return std::numeric_limits<float>::quiet_NaN(); }

}  // extern "C"
