#include "common/text/Elide.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "common/text/Printable.h"

namespace common {
namespace {

TEST(Elide, KeepsBothEnds) {
  const auto fits = [](std::size_t room) { return [=](const std::string& s) { return s.size() <= room; }; };
  EXPECT_EQ(elide_middle("count", fits(5)), "count");
  EXPECT_EQ(elide_middle("metric with a longer name 12", fits(13)), "metri...me 12");
  EXPECT_EQ(elide_middle("", fits(0)), "");
}

// Whatever the room, the longest text is chosen that fits, and no character is broken.
TEST(Elide, KeepsAsManyCharactersAsFit) {
  std::mt19937 random(20261129);
  const std::string characters[] = {"a", "é", "→", "𝄞", " "};
  for (int draw = 0; draw < 500; ++draw) {
    std::string text;
    for (int i = static_cast<int>(random() % 30); i > 0; --i) text += characters[random() % 5];
    const std::size_t room = 7 + random() % 60;
    const std::string shown = elide_middle(text, [&](const std::string& s) { return s.size() <= room; });
    EXPECT_EQ(shown, printable(shown));
    if (text.size() <= room) {
      EXPECT_EQ(shown, text);
      continue;
    }
    EXPECT_LE(shown.size(), room);
    EXPECT_GE(shown.size() + 8, room);
    const std::size_t dots = shown.find("...");
    EXPECT_TRUE(text.starts_with(shown.substr(0, dots)));
    EXPECT_TRUE(text.ends_with(shown.substr(dots + 3)));
  }
}

}  // namespace
}  // namespace common
