#include "common/text/Printable.h"

#include <gtest/gtest.h>

#include <string>

namespace common {
namespace {

std::string utf8(char32_t c) {
  const auto byte = [](char32_t bits) { return static_cast<char>(bits); };
  if (c < 0x80) return {byte(c)};
  if (c < 0x800) return {byte(0xC0 | c >> 6), byte(0x80 | (c & 0x3F))};
  if (c < 0x10000) return {byte(0xE0 | c >> 12), byte(0x80 | (c >> 6 & 0x3F)), byte(0x80 | (c & 0x3F))};
  return {byte(0xF0 | c >> 18), byte(0x80 | (c >> 12 & 0x3F)), byte(0x80 | (c >> 6 & 0x3F)),
          byte(0x80 | (c & 0x3F))};
}

TEST(Printable, KeepsEveryCharacterButControls) {
  for (char32_t c = 0; c < 0x110000; ++c) {
    const bool is_separator = c == 0x2028 || c == 0x2029;
    const bool is_mark = c == 0x061C || c == 0x200E || c == 0x200F;
    const bool is_bidirectional = is_mark || (c >= 0x202A && c <= 0x202E) || (c >= 0x2066 && c <= 0x2069);
    const bool is_control = c < 0x20 || (c >= 0x7F && c < 0xA0) || is_separator || is_bidirectional;
    const bool is_surrogate = c >= 0xD800 && c < 0xE000;
    const std::string text = utf8(c), expected = is_surrogate ? "???" : is_control ? "?" : text;
    ASSERT_EQ(printable(text), expected) << std::hex << static_cast<std::uint32_t>(c);
    ASSERT_EQ(printable("a" + text + "b"), "a" + expected + "b") << std::hex << static_cast<std::uint32_t>(c);
  }
}

TEST(Printable, LinesHaveBreaksAndTabs) {
  EXPECT_EQ(printable_lines("a\tb\n\x1B[1m\r"), "a\tb\n?[1m?");
  EXPECT_EQ(printable("a\tb\n"), "a?b?");
}

TEST(Printable, ReplacesEachByteThatIsNotUtf8) {
  EXPECT_EQ(printable("\x9B"
                      "31m"),
            "?31m");                                          // the C1 code of an escape sequence, alone
  EXPECT_EQ(printable("\xC0\xAF"), "??");                     // too long
  EXPECT_EQ(printable("\xF4\x90\x80\x80"), "????");           // beyond Unicode
  EXPECT_EQ(printable("\xE2\x82"), "??");                     // cut
  EXPECT_EQ(printable("\xE2\xE2\x82\xAC"), "?\xE2\x82\xAC");  // resumes at the next character
}

}  // namespace
}  // namespace common
