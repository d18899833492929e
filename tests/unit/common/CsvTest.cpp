#include "common/csv/Csv.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "common/text/Number.h"

using namespace common;

namespace {

TEST(Csv, SplitsAndTrims) {
  EXPECT_EQ(split_csv_line(" a ,\"b\",, c\r"), (std::vector<std::string_view>{"a", "b", "", "c"}));
  EXPECT_EQ(split_csv_line(""), std::vector<std::string_view>{""});
}

TEST(Csv, NumbersRoundTripBitExactly) {
  for (const float value : {0.1F, -3.4e38F, 1e-45F, 16777217.0F}) {
    std::string text;
    append_shortest(text, value);
    EXPECT_EQ(parse_csv_number<float>(text), value) << text;
  }
}

TEST(Csv, RejectsInvalidNumbers) {
  for (const char* text : {"", "x", "1 2", "1,5", "--1", "0x10"})
    EXPECT_FALSE(parse_csv_number<float>(text)) << text;
  EXPECT_EQ(parse_csv_number<int>("+7"), 7);
  EXPECT_EQ(parse_csv_number<float>("1e99"), std::numeric_limits<float>::infinity());
}

TEST(Csv, QuotesFieldsPerRfc4180) {
  std::string text;
  append_csv_field(text, "plain");
  append_csv_field(text += ',', "a \"b\", c");
  EXPECT_EQ(text, "plain,\"a \"\"b\"\", c\"");
}

}  // namespace
