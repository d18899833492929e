#include "common/state/StateArchive.h"

#include <gtest/gtest.h>

namespace common {
namespace {

struct Nested {
  std::vector<float> values;
  std::string name;
  void archive(StateArchive& a) { a(values, name); }
};

struct Everything {
  int number = 0;
  std::optional<double> maybe;
  std::vector<Nested> nested;
  std::array<std::vector<int>, 2> lists;
  std::vector<std::pair<std::string, double>> pairs;
  void archive(StateArchive& a) { a(number, maybe, nested, lists, pairs); }
};

TEST(StateArchive, RestoresWhatWasSaved) {
  Everything saved{7, 0.5, {{{1.0F, 2.0F}, "one"}, {{}, ""}}, {{{3}, {4, 5}}}, {{"x", 1.5}}};
  std::string bytes;
  StateArchive out(bytes);
  out(saved);
  Everything restored{1, {}, {{}, {}, {}}, {{{9, 9}, {9}}}, {}};
  StateArchive in{std::string_view(bytes)};
  in(restored);
  EXPECT_TRUE(in.at_end());
  EXPECT_EQ(restored.number, 7);
  EXPECT_EQ(restored.maybe, 0.5);
  ASSERT_EQ(restored.nested.size(), 2U);
  EXPECT_EQ(restored.nested[0].values, (std::vector{1.0F, 2.0F}));
  EXPECT_EQ(restored.nested[0].name, "one");
  EXPECT_EQ(restored.lists, saved.lists);
  EXPECT_EQ(restored.pairs, saved.pairs);
}

TEST(StateArchive, RefusesEveryShorterText) {
  Everything saved{7, 0.5, {{{1.0F, 2.0F}, "one"}}, {{{3}, {4, 5}}}, {{"x", 1.5}}};
  std::string bytes;
  StateArchive out(bytes);
  out(saved);
  for (std::size_t length = 0; length < bytes.size(); ++length) {
    Everything restored;
    StateArchive in{std::string_view(bytes).substr(0, length)};
    EXPECT_THROW(in(restored), UserError) << length;
  }
}

TEST(StateArchive, RefusesSizesBeyondTheText) {
  std::string bytes;
  StateArchive out(bytes);
  std::uint64_t size = ~std::uint64_t{0};
  out(size);
  std::vector<double> numbers;
  StateArchive in{std::string_view(bytes)};
  EXPECT_THROW(in(numbers), UserError);
}

}  // namespace
}  // namespace common
