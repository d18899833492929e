// The mathematical functions differ from the true value, by the C library in double precision, by less than
// two units in the last place, many by less than one, for random and special arguments, and follow C's rules
// at the ends. That the kernels of every instruction set have the same bits is ElementwiseAgreementTest's.
// All floats: apron_properties --gtest_also_run_disabled_tests --gtest_filter='*EveryFloat*', some minutes a
// function; APRON_FLOAT_STRIDE=97 takes every 97th of them.
#include "apron/program/Mathematics.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdlib>
#include <functional>
#include <random>
#include <vector>

#include "tests/unit/common/ProgramSeeds.h"

namespace apron::program {
namespace {

struct Function {
  const char* name;
  Opcode op;
  double (*reference)(double, double);
  double low, high;  // most arguments
  double bound;      // of the error
  bool is_binary = false;
};

const std::vector<Function> kFunctions = {
    {"exp", Opcode::kExp, [](double a, double) { return std::exp(a); }, -110, 95, 1.0},
    {"ln", Opcode::kLn, [](double a, double) { return std::log(a); }, 0, 4, 1.0},
    {"log", Opcode::kLog, [](double a, double) { return std::log10(a); }, 0, 4, 0.6},
    {"sin", Opcode::kSin, [](double a, double) { return std::sin(a); }, -20, 20, 1.6},
    {"cos", Opcode::kCos, [](double a, double) { return std::cos(a); }, -20, 20, 2.0},
    {"tan", Opcode::kTan, [](double a, double) { return std::tan(a); }, -20, 20, 2.0},
    {"sinh", Opcode::kSinh, [](double a, double) { return std::sinh(a); }, -92, 92, 1.7},
    {"cosh", Opcode::kCosh, [](double a, double) { return std::cosh(a); }, -92, 92, 1.7},
    {"tanh", Opcode::kTanh, [](double a, double) { return std::tanh(a); }, -10, 10, 1.6},
    {"asin", Opcode::kAsin, [](double a, double) { return std::asin(a); }, -1, 1, 1.5},
    {"acos", Opcode::kAcos, [](double a, double) { return std::acos(a); }, -1, 1, 1.5},
    {"atan", Opcode::kAtan, [](double a, double) { return std::atan(a); }, -10, 10, 1.7},
    {"pow", Opcode::kPow, [](double a, double b) { return std::pow(a, b); }, -8, 8, 2.0, true},
    {"atan2", Opcode::kAtan2, [](double a, double b) { return std::atan2(a, b); }, -3, 3, 1.8, true},
};

constexpr float kSpecial[] = {0.0F,
                              -0.0F,
                              0.5F,
                              -0.5F,
                              1.0F,
                              -1.0F,
                              2.0F,
                              -3.0F,
                              3.0F,
                              1.5F,
                              -2.5F,
                              0x1p-149F,
                              -0x1p-149F,
                              0x1p-126F,
                              0x1p-30F,
                              -0x1p-14F,
                              1.5707964F,
                              3.1415927F,
                              -4.712389F,
                              0x1.921fb6p+20F,
                              0x1p20F,
                              0x1.fffffep19F,
                              -0x1.000002p20F,
                              1e10F,
                              -1e22F,
                              16777217.0F,
                              88.72284F,
                              -103.97208F,
                              0x1.fffffep127F,
                              -0x1.fffffep127F,
                              INFINITY,
                              -INFINITY,
                              NAN};

// In units in the last place of the result; at least those of the smallest normal number's denormals.
double error_in_ulps(float value, double reference) {
  const auto rounded = static_cast<float>(reference);
  if (std::isnan(reference) || std::isinf(rounded) || std::isinf(value)) {
    // A result that rounds to infinity may be the largest number, and the other way round, within half a
    // unit.
    const bool is_same = std::isnan(reference) ? std::isnan(value) : value == rounded;
    return is_same ? 0.0 : INFINITY;
  }
  if (std::signbit(value) != std::signbit(rounded)) return INFINITY;
  const int exponent = std::max(std::ilogb(reference == 0.0 ? 0x1p-149 : reference), -126);
  return std::fabs(value - reference) / std::ldexp(1.0, exponent - 23);
}

class Mathematics : public testing::TestWithParam<Function> {};

TEST_P(Mathematics, DiffersByLessThanItsBound) {
  const Function& function = GetParam();
  std::mt19937 rng(40 + first_program_seed());
  std::size_t compared = 0;
  double worst = 0.0;
  const auto check = [&](float a, float b) {
    const float value = evaluate_mathematics(function.op, a, b);
    const double error = error_in_ulps(value, function.reference(a, b));
    worst = std::max(worst, error);
    ++compared;
    ASSERT_LT(error, function.bound) << function.name << fmt::format("({:a}, {:a}) = {:a}", a, b, value);
  };
  std::uniform_real_distribution<float> usual(static_cast<float>(function.low),
                                              static_cast<float>(function.high));
  for (int i = 0; i < 400'000; ++i) {
    check(usual(rng), usual(rng));
    if (HasFatalFailure()) return;
    check(std::bit_cast<float>(static_cast<std::uint32_t>(rng())),
          i % 2 == 0 ? usual(rng) : std::bit_cast<float>(static_cast<std::uint32_t>(rng())));
    if (HasFatalFailure()) return;
  }
  for (const float a : kSpecial)
    for (const float b : kSpecial) check(a, b);
  // Near whole powers and multiples of pi / 2, where differences cancel.
  for (int i = 0; i < 100'000; ++i) {
    const float near_one = 1.0F + static_cast<float>(static_cast<int>(rng() % 4001) - 2000) * 0x1p-23F;
    check(near_one, std::ldexp(usual(rng), static_cast<int>(rng() % 24)));
    const auto angle = static_cast<float>(1.5707963267948966 * static_cast<double>(rng() % 3'000'000));
    check(angle, angle);
    // Powers near the largest and the least number, where an error of the logarithm counts most.
    const float base = std::bit_cast<float>(0x3F000000U + static_cast<std::uint32_t>(rng() % 0x1000000U));
    check(base, static_cast<float>((static_cast<double>(rng() % 280'000) * 1e-3 - 151.0) / std::log2(base)));
    if (HasFatalFailure()) return;
  }
  RecordProperty("worst", fmt::format("{}", worst));
  count_cases(compared);
}

TEST_P(Mathematics, DISABLED_EveryFloat) {
  const Function& function = GetParam();
  if (function.is_binary) GTEST_SKIP();
  const char* const text = std::getenv("APRON_FLOAT_STRIDE");
  const std::uint64_t stride = text != nullptr ? std::strtoull(text, nullptr, 10) : 1;
  ASSERT_GT(stride, 0U);
  double worst = 0.0;
  float at = 0.0F;
  for (std::uint64_t bits = 0; bits < std::uint64_t{1} << 32U; bits += stride) {
    const auto x = std::bit_cast<float>(static_cast<std::uint32_t>(bits));
    const double error =
        error_in_ulps(evaluate_mathematics(function.op, x, 0.0F), function.reference(x, 0.0));
    if (error <= worst) continue;
    worst = error;
    at = x;
  }
  fmt::print("{}: {:.4f} units in the last place, at {:a}\n", function.name, worst, at);
  EXPECT_LT(worst, function.bound);
}

INSTANTIATE_TEST_SUITE_P(All, Mathematics, testing::ValuesIn(kFunctions),
                         [](const auto& one) { return std::string(one.param.name); });

}  // namespace
}  // namespace apron::program
