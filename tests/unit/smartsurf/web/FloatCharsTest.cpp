// The conversions that the live page's library lacks, against GCC's.
#include "smartsurf/web/libcxx/FloatChars.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <random>
#include <string>
#include <string_view>

namespace smartsurf::web::libcxx {
namespace {

constexpr int kDraws = 100'000;

template <class Number, class Bits>
Number from_bits(Bits bits) {
  static_assert(sizeof(Number) == sizeof(Bits));
  Number value;
  std::memcpy(&value, &bits, sizeof value);
  return value;
}

// Any bits, or a number with few digits, as people write.
template <class Number, class Bits>
Number draw(std::mt19937_64& random) {
  if (random() % 2 == 0) return from_bits<Number>(static_cast<Bits>(random()));
  const double sign = random() % 2 == 0 ? 1.0 : -1.0;
  const auto digits = static_cast<double>(random() % (std::uint64_t{1} << random() % 50));
  return static_cast<Number>(sign * digits * std::pow(10.0, static_cast<double>(random() % 40) - 20.0));
}

template <class Convert>
std::string text_of(const Convert& convert) {
  std::array<char, 512> text{};
  const std::to_chars_result result = convert(text.data(), text.data() + text.size());
  EXPECT_EQ(result.ec, std::errc());
  return {text.data(), result.ptr};
}

template <class Number>
void expect_equal_texts(Number value) {
  EXPECT_EQ(text_of([=](char* a, char* b) { return libcxx::to_chars(a, b, value); }),
            text_of([=](char* a, char* b) { return std::to_chars(a, b, value); }));
  for (const std::chars_format format :
       {std::chars_format::general, std::chars_format::fixed, std::chars_format::scientific})
    EXPECT_EQ(text_of([=](char* a, char* b) { return libcxx::to_chars(a, b, value, format); }),
              text_of([=](char* a, char* b) { return std::to_chars(a, b, value, format); }))
        << "format " << static_cast<int>(format);
}

template <class Number>
void expect_equal_numbers(const std::string& text) {
  for (const std::chars_format format :
       {std::chars_format::general, std::chars_format::fixed, std::chars_format::scientific}) {
    Number ours = 7, theirs = 7;
    const char *const first = text.data(), *const last = first + text.size();
    const std::from_chars_result a = libcxx::from_chars(first, last, ours, format),
                                 b = std::from_chars(first, last, theirs, format);
    EXPECT_EQ(a.ptr - first, b.ptr - first) << text;
    EXPECT_EQ(a.ec, b.ec) << text;
    if (std::isnan(theirs))
      EXPECT_TRUE(std::isnan(ours)) << text;
    else
      EXPECT_EQ(ours, theirs) << text;
  }
}

TEST(FloatChars, TextsAreThoseOfTheStandardLibrary) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  for (const double value :
       {0.0, -0.0, kInfinity, -kInfinity, 1e5, 1e6, 100000.0, 123456.0, 1234567.0, 1e-4, 1e-5, 1e22, 1e23})
    expect_equal_texts(value), expect_equal_texts(static_cast<float>(value));
  std::mt19937_64 random(20);
  for (int i = 0; i < kDraws && !HasFailure(); ++i) {
    expect_equal_texts(draw<float, std::uint32_t>(random));
    expect_equal_texts(draw<double, std::uint64_t>(random));
  }
}

TEST(FloatChars, NumbersAreThoseOfTheStandardLibrary) {
  constexpr std::string_view kAlphabet = "0012345678999..eE+-";
  std::mt19937_64 random(21);
  for (int i = 0; i < kDraws && !HasFailure(); ++i) {
    std::string text;
    if (random() % 2 == 0) {
      text =
          text_of([&](char* a, char* b) { return std::to_chars(a, b, draw<double, std::uint64_t>(random)); });
    } else {
      text = random() % 2 == 0 ? "-" : "";
      for (std::uint64_t length = 1 + random() % 12; length > 0; --length)
        text += kAlphabet[random() % kAlphabet.size()];
    }
    expect_equal_numbers<double>(text);
    expect_equal_numbers<float>(text);
  }
}

TEST(FloatChars, RefuseWhatDoesNotFit) {
  std::array<char, 4> text{};
  EXPECT_EQ(libcxx::to_chars(text.data(), text.data() + text.size(), 1.2345).ec, std::errc::value_too_large);
  EXPECT_EQ(libcxx::to_chars(text.data(), text.data() + text.size(), 1.0, std::chars_format::hex).ec,
            std::errc::invalid_argument);
}

}  // namespace
}  // namespace smartsurf::web::libcxx
