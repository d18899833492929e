// Mutates a valid script. Every mutation must run or be rejected with a one-line error.
#include <random>

#include "ScriptFixture.h"

namespace smartsurf::script {
namespace {

constexpr const char* kSeedScript = R"(
world{gravity = -9.81, dt = 1/240, iterations = 10, control_period = 1/60, seed = 1, ground = true}
material{name = 'steel', friction = 0.5, rolling_friction = 0.01, restitution = 0.2, density = 1.0}
surface{rows = 8, columns = 8, pitch = 1.0, actuator = pin{top = {0.8, 0.8}, length = 2.0, range = {0, 6}},
        sensors = {proximity{range = 8}}, border = {height = 6}, material = 'steel'}
local count = option('count', 4, 'number of spheres')
local ids = {}
for i = 1, count do
  ids[#ids + 1] = sphere{radius = 0.5 + i / 10, position = {random(0, 7), random(0, 7), 8}, colour = 'red',
                         material = 'steel', label = 'small', velocity = {0, 0, -1}}
end
box{size = {1, 2, 3}, position = {4, 4, 20}, orientation = {axis = {0, 0, 1}, angle = 0.5}, mass = 2}
cylinder{radius = 1, height = 2, position = {2, 2, 9}, colour = '#10ff20', fixed = true}
at(0.01, function(t) object(ids[1]):push{force = {1, 0, 0}, seconds = 0.5} end)
every(0.02, function(t) sphere{radius = 1, position = {1, 1, 9}} return t < 1 end)
on_tick(function(t, n)
  cells:target('height', 1 + n % 8, 3, 2.0)
  local values = {}
  for i = 1, 64 do values[i] = math.sin(i / 5 + t) end
  cells:targets('height', values)
  for k, o in pairs(objects{label = 'small'}) do o:teleport{position = {o:position()}} end
  if cells:sense('proximity', 2, 3) > 1e6 then stop() end
end)
on_finish(function() print('done', #objects()) end)
record{objects = true, sensors = false, every = 1}
)";

class Mutator {
 public:
  explicit Mutator(unsigned seed) : random_(seed) {}

  std::string mutated(std::string text) {
    for (int changes = 1 + below(3); changes > 0; --changes) change(text);
    return text;
  }

 private:
  int below(std::size_t n) { return n == 0 ? 0 : static_cast<int>(random_() % n); }

  void change(std::string& text) {
    static const std::vector<std::string> kWords{
        "0/0",     "1e308", "-1",  "nil", "{}",   "'x'", "true",  "function() end",
        "1 << 62", "print", "(",   ")",   "end",  ",",   "}",     "while 1 do",
        "..",      "pairs", "[1]", "#",   "\x1b", "\n",  "{1,2}", "''"};
    const auto at = static_cast<std::size_t>(below(text.size()));
    const auto length = static_cast<std::size_t>(below(20));
    switch (below(6)) {
      case 0:
        text.erase(at, length);
        break;
      case 1:
        text.insert(at, kWords[static_cast<std::size_t>(below(kWords.size()))]);
        break;
      case 2:
        text[at] = static_cast<char>(below(256));
        break;
      case 3:
        text.insert(at, text.substr(static_cast<std::size_t>(below(text.size())), length));
        break;
      case 4:
        replace_number(text, at);
        break;
      default:
        std::swap(text[at], text[static_cast<std::size_t>(below(text.size()))]);
    }
    if (text.empty()) text = " ";
  }

  void replace_number(std::string& text, std::size_t from) {
    const std::size_t at = text.find_first_of("0123456789", from);
    if (at == std::string::npos) return;
    const std::vector<std::string> values{"0/0", "-1",  "1e300",        "0", "1/0", "'a'",
                                          "{}",  "0.5", "1000000000000"};
    text.replace(at, 1, values[static_cast<std::size_t>(below(values.size()))]);
  }

  std::mt19937 random_;  // portable, unlike the standard distributions
};

using FuzzTest = ScriptTest;

TEST_F(FuzzTest, MutationsRunOrFailWithOneLine) {
  options.load_budget = options.callback_budget = 100'000;
  options.memory_limit = 16 << 20;
  options.output_folder = folder;
  Mutator mutator(20240607);
  int good = 0, refused = 0;
  for (int i = 0; i < 2000; ++i) {
    const std::string text = mutator.mutated(kSeedScript);
    try {
      Experiment e = load(text);
      FakeSimulation simulation(e.scene());
      e.start(simulation);
      run_ticks(e, 0, 4);
      e.finish();
      ++good;
    } catch (const scene::InputError& error) {
      const std::string message = error.what();
      ASSERT_EQ(message.find('\n'), std::string::npos) << message << "\n" << text;
      ASSERT_TRUE(message.starts_with((folder / "t.lua").string() + ":")) << message << "\n" << text;
      ASSERT_LT(message.size(), 2000u) << message;
      ++refused;
    }
  }
  EXPECT_GT(good, 50);
  EXPECT_GT(refused, 500);
}

}  // namespace
}  // namespace smartsurf::script
