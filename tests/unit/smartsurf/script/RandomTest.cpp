#include "smartsurf/script/Random.h"

#include <algorithm>
#include <array>
#include <set>

#include "ScriptFixture.h"

namespace smartsurf::script {
namespace {

// The reference outputs of SplitMix64 for seed 1234567.
TEST(Random, MatchesSplitMix64) {
  Random r(1234567);
  for (const std::uint64_t expected : {6457827717110365317u, 3203168211198807973u, 9817491932198370423u,
                                       4593380528125082431u, 16408922859458223821u})
    EXPECT_EQ(r.next(), expected);
}

TEST(Random, UniformStaysInBounds) {
  Random r(3);
  double lowest = 1.0, highest = 0.0;
  for (int i = 0; i < 100000; ++i) {
    const double v = r.uniform(-2.0, 3.0);
    ASSERT_GE(v, -2.0);
    ASSERT_LT(v, 3.0);
    lowest = std::min(lowest, v), highest = std::max(highest, v);
  }
  EXPECT_LT(lowest, -1.999);
  EXPECT_GT(highest, 2.999);
  EXPECT_EQ(r.uniform(5.0, 5.0), 5.0);
  const double big = r.uniform(-1e308, 1e308);
  EXPECT_TRUE(big >= -1e308 && big <= 1e308);
}

TEST(Random, IntegersAreUniform) {
  Random r(9);
  std::array<int, 6> counts{};
  for (int i = 0; i < 60000; ++i) ++counts[static_cast<std::size_t>(r.uniform_integer(1, 6) - 1)];
  for (const int count : counts) EXPECT_NEAR(count, 10000, 400);
  EXPECT_EQ(r.uniform_integer(-4, -4), -4);
  r.uniform_integer(INT64_MIN, INT64_MAX);
}

// The draws of purposes, of seeds that follow each other, and of Random(seed) are all different.
TEST(Random, StreamsDoNotMeet) {
  std::set<std::uint64_t> seen;
  for (std::uint64_t seed = 0; seed < 100; ++seed)
    for (Random r : {Random(seed), Random::stream(seed, "reset"), Random::stream(seed, "step"),
                     Random::stream(seed, "named reset")})
      for (int i = 0; i < 100; ++i) seen.insert(r.next());
  EXPECT_EQ(seen.size(), 100u * 4 * 100);
}

class ScriptRandomTest : public ScriptTest {
 protected:
  std::string draws(const std::string& text) {
    printed.clear();
    load_on_surface(text);
    return printed;
  }
};

TEST_F(ScriptRandomTest, SameSeedGivesSameSequence) {
  const std::string text =
      "world{seed = 5} print(string.format('%.17g %.17g', random(0, 10), math.random()), "
      "math.random(6), math.random(10, 20))";
  const std::string first = draws(text);
  EXPECT_EQ(draws(text), first);
  EXPECT_EQ(first, "3.8676804598393399 0.7523070158382239\t6\t10\n");
  EXPECT_NE(draws("world{seed = 6} print(string.format('%.17g', random(0, 10)))"), first);
}

TEST_F(ScriptRandomTest, NamedStreamsAreIndependentOfEachOther) {
  EXPECT_EQ(draws("random_stream('a') print(random_stream('b'), random())"),
            draws("print(random_stream('b'), random()) random_stream('a')"));
  EXPECT_NE(draws("print(random_stream('a'))"), draws("print(random_stream('b'))"));
  EXPECT_EQ(draws("print(random_stream('a', 3, 3))"), "3.0\n");
  EXPECT_EQ(error_of("random_stream('a', 2, 1)"), "t.lua:1: random_stream: low = 2 is above high = 1");
  EXPECT_EQ(error_of("local x = random_stream('a')\nworld{seed = 5}"),
            "t.lua:2: world.seed = 5: random numbers were already drawn with seed 1 at t.lua:1; declare "
            "world{} before that");
}

TEST_F(ScriptRandomTest, NamesOfStreamsBeginWithAnyCharacter) {
  for (const std::string& name :
       {std::string("1a"), std::string("-"), std::string("_"), std::string(60, 'a')})
    EXPECT_NE(draws("print(random_stream('" + name + "'))"), draws("print(random_stream('x'))"));
  for (const std::string& name : {std::string(), std::string("a b"), std::string("ä"), std::string(61, 'a')})
    EXPECT_TRUE(
        error_of("random_stream('" + name + "')").ends_with("': must be 1 to 60 letters, digits, _ and -"))
        << name;
}

TEST_F(ScriptRandomTest, IntegerOfAnyBits) {
  Random stream(5);
  const auto first = static_cast<std::int64_t>(stream.next()),
             second = static_cast<std::int64_t>(stream.next());
  EXPECT_EQ(draws("world{seed = 5} print(math.random(0), math.random(0))"),
            std::to_string(first) + "\t" + std::to_string(second) + "\n");
  EXPECT_EQ(error_of("math.random(-1)"), "t.lua:1: math.random: low = 1 is above high = -1");
  EXPECT_EQ(error_of("math.random(1, 0)"), "t.lua:1: math.random: low = 1 is above high = 0");
}

TEST_F(ScriptRandomTest, DefaultSeedIsOne) {
  EXPECT_EQ(draws("print(random())"), draws("world{seed = 1} print(random())"));
}

TEST_F(ScriptRandomTest, CommandLineSeedOverridesScript) {
  const std::string seven = draws("world{seed = 7} print(random())");
  options.seed = 7;
  EXPECT_EQ(draws("world{seed = 5} print(random())"), seven);
  EXPECT_EQ(draws("print(random()) world{seed = 5}"), seven);
  EXPECT_EQ(load_on_surface("world{seed = 5}").scene().world.seed, 7u);
}

TEST_F(ScriptRandomTest, RejectsSeedAfterFirstDraw) {
  EXPECT_EQ(error_of("local x = random()\n\nworld{seed = 5}"),
            "t.lua:3: world.seed = 5: random numbers were already drawn with seed 1 at t.lua:1; declare "
            "world{} before that");
  EXPECT_EQ(error_of("surface{} local x = random()\nworld{dt = 1/120}"), "");
}

TEST_F(ScriptRandomTest, PairsAndNextAreOrdered) {
  const std::string text = R"(
    local t = {zebra = 1, apple = 2, mango = 3, [3] = 'c', [1] = 'a', [2] = 'b', [2.5] = 'h', [-1] = 'n',
               [true] = 't', [false] = 'f', [print] = 'p'}
    local s, u = '', ''
    for k, v in pairs(t) do s = s .. v end
    for k, v in next, t do u = u .. v end
    print(s, u, next({}), (next{7})))";
  EXPECT_EQ(draws(text), "nabhc231ftp\tnabhc231ftp\tnil\t1\n");
}

TEST_F(ScriptRandomTest, PairsAllowsRemovalAndHonoursMetamethods) {
  EXPECT_EQ(draws("local t = {1, 2, 3, x = 4, y = 5} for k in pairs(t) do t[k] = nil; t.y = nil end "
                  "print((next(t)))"),
            "nil\n");
  EXPECT_EQ(
      draws("local t = {1, 2, 3, 4} local n = 0 for k in pairs(t) do n = n + 1; t[k + 1] = nil end print(n)"),
      "2\n");
  EXPECT_EQ(
      draws(
          "local t = setmetatable({}, {__pairs = function() return function(_, k) if not k then return 1 end "
          "end, nil, nil end}) for k in pairs(t) do print(k) end"),
      "1\n");
}

TEST_F(ScriptRandomTest, PairsRejectsUnorderedKeys) {
  EXPECT_EQ(error_of("\nfor k in pairs{[{}] = 1, [{}] = 2} do end"),
            "t.lua:2: pairs: the table has several keys without an order, such as a table; their order would "
            "differ from run to run: use a list, or number or string keys");
}

}  // namespace
}  // namespace smartsurf::script
