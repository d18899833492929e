// Programs as C for boards leave the bits of the virtual machine in every actuator frame: random local
// programs, on random splits of the table into tiles, with halos of several widths and messages that come
// late.
#include <dlfcn.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <bit>
#include <cstdlib>
#include <cstring>
#include <deque>
#include <filesystem>
#include <fstream>
#include <functional>
#include <memory>
#include <regex>

#include "apron/compiler/Compiler.h"
#include "apron/program/LocalityCheck.h"
#include "apron/program/Reachability.h"
#include "apron/syntax/FileReader.h"
#include "apron/target_c/TargetC.h"
#include "common/error/UserError.h"
#include "tests/property/apron/RandomProgram.h"

namespace apron::vm::test {
namespace {

namespace fs = std::filesystem;

constexpr int kTicks = 4;
constexpr double kPeriod = 0.015625;

// The part of a member's name that stands for the channel: 'colour.r' is colour_r.
std::string member_name(std::string_view channel) {
  std::string name;
  for (const char c : channel)
    if (c != ']') name += std::isalnum(static_cast<unsigned char>(c)) != 0 ? c : '_';
  return name;
}

// The frames that a surface gives to a program, as a function of the tick, and those that it takes. Channels
// of hits are 0 or 1.
Cells sensor_frame(const std::string& channel, std::uint32_t tick, std::size_t cells, unsigned seed) {
  const bool is_truth = channel == "truths" || channel.ends_with("hit");
  std::uint32_t name = 0;
  for (const char c : channel) name = name * 31 + static_cast<unsigned char>(c);
  std::mt19937 rng(seed * 1000 + tick * 2 + name);
  if (channel == "bits") {  // floats of every size
    Cells frame(cells);
    for (float& c : frame) c = std::bit_cast<float>(static_cast<std::uint32_t>(rng()));
    return frame;
  }
  if (!is_truth) return random_input(cells, seed, rng);
  Cells frame(cells);
  for (float& c : frame) c = rng() % 3 == 0 ? 1.0F : 0.0F;
  return frame;
}

class SurfaceFrames : public FakeHost {
 public:
  SurfaceFrames(std::size_t cells, unsigned seed) : cells_(cells), seed_(seed) {}
  HostStatus sense(std::string_view channel, Plane to) override {
    write_cells(to,
                sensor_frame(member_name(channel), static_cast<std::uint32_t>(step_count), cells_, seed_));
    return HostStatus::kOk;
  }
  HostStatus step() override {
    for (auto& [name, frame] : actuators)
      if (frame.size() == 1) frame.assign(cells_, frame[0]);
    auto& frame = frames.emplace_back();
    for (const auto& [name, cells] : actuators) frame[member_name(name)] = cells;
    ++step_count;
    return HostStatus::kOk;
  }
  std::optional<double> time_s() const override { return kPeriod * step_count; }
  std::optional<double> dt_s() const override { return kPeriod; }

  std::vector<std::map<std::string, Cells>> frames;

  // Like the generated code: every channel that the program names.
  bool has(std::string_view) const override { return true; }

 private:
  const std::size_t cells_;
  const unsigned seed_;
};

// ---- the generated code ----

struct Links {
  void* context;
  void (*begin)(void*, void*, std::uint32_t);
  int (*send)(void*, int, std::uint16_t, const std::uint8_t*, std::uint16_t);
  int (*receive)(void*, int, std::uint16_t, std::uint8_t*, std::uint16_t);
  void (*end)(void*, void*, std::uint32_t);
};
enum { kDone, kEdges, kEnded, kFailed };
enum { kReady, kNotYet, kGivenUp };

// A compiled tile: its functions, by name.
struct TileCode {
  std::uint32_t columns = 0, rows = 0;
  std::string name;
  unsigned (*size)() = nullptr;
  int (*init)(void*, const Links*, int, int, int, int) = nullptr;
  int (*run)(void*) = nullptr;
  const char* (*error)(const void*) = nullptr;
  float* (*channel)(void*, int) = nullptr;
  std::vector<std::string> members;
  void (*clock)(void*, double, double, double) = nullptr;
};

// The names of the members of the state that hold frames.
std::vector<std::string> frame_members(const std::string& header) {
  static const std::regex kMember("float ((?:sense|actuate)_\\w+)\\[");
  std::vector<std::string> members;
  for (std::sregex_iterator i(header.begin(), header.end(), kMember), end; i != end; ++i)
    members.push_back((*i)[1]);
  return members;
}

// Functions that find the members of the state, whose names depend on the program.
std::string access_text(const std::string& name, const std::string& header) {
  std::string text = "unsigned " + name + "_size(void) { return sizeof(" + name + "_state); }\nfloat *" +
                     name + "_channel(" + name + "_state *s, int channel) {\n  (void)channel;\n";
  const std::vector<std::string> members = frame_members(header);
  for (std::size_t i = 0; i < members.size(); ++i)
    text += "  if (channel == " + std::to_string(i) + ") return s->" + members[i] + ";\n";
  text += "  (void)s;\n  return 0;\n}\nvoid " + name + "_clock(" + name +
          "_state *s, double tick, double time, double period) {\n";
  for (const auto& [member, value] :
       {std::pair{"tick", "tick"}, {"time_s", "time"}, {"period_s", "period"}}) {
    const bool has = header.find(std::string("double ") + member + ";") != std::string::npos;
    text += (has ? "  s->" + std::string(member) + " = " : std::string("  (void)")) + value + ";\n";
  }
  return text + "  (void)s;\n}\n";
}

// Programs compiled together, because starting a compiler takes longer than compiling one.
class Library {
 public:
  Library() {
    char pattern[] = "/tmp/apron-target-c-XXXXXX";
    folder_ = mkdtemp(pattern);
  }
  ~Library() {
    if (handle_ != nullptr) dlclose(handle_);
    std::error_code ignored;
    fs::remove_all(folder_, ignored);
  }
  Library(const Library&) = delete;
  Library& operator=(const Library&) = delete;

  void add(const target_c::Options& options, const target_c::Generated& generated) {
    std::ofstream(folder_ / (options.name + ".h")) << generated.header;
    members_[options.name] = frame_members(generated.header);
    // Every other program computes scalars as where a double has 32 bits.
    std::string define = "#define " + options.name + "_SOFT_WIDE 1\n";
    std::ranges::transform(define, define.begin(), [](unsigned char c) { return std::toupper(c); });
    define.replace(0, 7, "#define");
    std::ofstream(folder_ / (options.name + ".c"))
        << (members_.size() % 2 == 0 ? define : "") << generated.source
        << access_text(options.name, generated.header);
  }
  // True if the C compiles without a warning.
  bool build() {
    const std::string library = (folder_ / "tiles.so").string();
    const std::string command =
        std::string(APRON_C_COMPILER) +
        " -std=c99 -Wall -Wextra -Wpedantic -Wno-unused-function -Werror -O1 -fPIC -shared -o " + library +
        " " + folder_.string() + "/*.c";
    if (std::system(command.c_str()) != 0) return false;
    handle_ = dlopen(library.c_str(), RTLD_NOW | RTLD_LOCAL);
    return handle_ != nullptr;
  }
  TileCode find(const std::string& name, std::uint32_t columns, std::uint32_t rows) const {
    TileCode code;
    code.columns = columns;
    code.rows = rows;
    code.name = name;
    code.members = members_.at(name);
    const auto bind = [&](auto& function, const char* suffix) {
      function = reinterpret_cast<std::decay_t<decltype(function)>>(dlsym(handle_, (name + suffix).c_str()));
      EXPECT_NE(function, nullptr) << name << suffix;
    };
    bind(code.size, "_size");
    bind(code.init, "_init");
    bind(code.run, "_run");
    bind(code.error, "_error");
    bind(code.channel, "_channel");
    bind(code.clock, "_clock");
    return code;
  }

 private:
  fs::path folder_;
  std::map<std::string, std::vector<std::string>> members_;
  void* handle_ = nullptr;
};

// ---- a table of tiles in one process ----

struct Message {
  std::uint32_t tick = 0;
  std::uint16_t round = 0;
  std::vector<std::uint8_t> bytes;
};

class Table;

struct Tile {
  Table* table = nullptr;
  TileCode code;
  std::uint32_t row = 0, column = 0, tick = 0;
  std::vector<double> memory;
  std::array<Tile*, 4> neighbours{};
  std::array<std::deque<Message>, 4> inbox;  // from that side
  void* state() { return memory.data(); }
};

// How a table is cut: the widths of its columns of tiles and the heights of its rows.
struct Split {
  std::vector<std::uint32_t> widths, heights;
  std::uint32_t halo = 1, unroll = 20000;
};

class Table {
 public:
  Table(Size size, const Split& split,
        const std::map<std::pair<std::uint32_t, std::uint32_t>, TileCode>& codes, unsigned seed)
      : size_(size), seed_(seed), rng_(seed) {
    std::uint32_t row = 0;
    for (const std::uint32_t height : split.heights) {
      std::uint32_t column = 0;
      for (const std::uint32_t width : split.widths) {
        auto& tile = tiles_.emplace_back(std::make_unique<Tile>());
        tile->table = this;
        tile->code = codes.at({width, height});
        tile->row = row;
        tile->column = column;
        tile->memory.resize(tile->code.size() / sizeof(double) + 1);
        column += width;
      }
      row += height;
    }
    const std::size_t across = split.widths.size();
    for (std::size_t i = 0; i < tiles_.size(); ++i) {
      if (i % across > 0) join(i, i - 1, 0, 1);
      if (i >= across) join(i, i - across, 2, 3);
    }
    const Links links{nullptr, begin, send, receive, end};
    for (auto& tile : tiles_) {
      Links own = links;
      own.context = tile.get();
      EXPECT_EQ(
          tile->code.init(tile->state(), &own, static_cast<int>(tile->row), static_cast<int>(tile->column),
                          static_cast<int>(size.height), static_cast<int>(size.width)),
          0)
          << tile->code.name;
    }
  }

  // Runs all tiles in random turns until each has completed `ticks`, and returns the frames of each tick.
  std::vector<std::map<std::string, Cells>> run(int ticks) {
    frames_.assign(static_cast<std::size_t>(ticks), {});
    for (int idle = 0; idle < 100000; ++idle) {
      bool busy = false;
      for (auto& tile : tiles_) {
        if (tile->tick >= static_cast<std::uint32_t>(ticks) || rng_() % 4 == 0) {
          busy = busy || tile->tick < static_cast<std::uint32_t>(ticks);
          continue;
        }
        busy = true;
        const int status = tile->code.run(tile->state());
        if (status == kDone) ++tile->tick;
        if (status == kEnded) tile->tick = static_cast<std::uint32_t>(ticks);
      }
      if (!busy) return frames_;
    }
    ADD_FAILURE() << "the tiles wait for each other";
    return frames_;
  }

 private:
  void join(std::size_t a, std::size_t b, int side_of_a, int side_of_b) {
    tiles_[a]->neighbours[static_cast<std::size_t>(side_of_a)] = tiles_[b].get();
    tiles_[b]->neighbours[static_cast<std::size_t>(side_of_b)] = tiles_[a].get();
  }
  template <class Copy>
  static void with_cells(Tile& tile, Cells& frame, float* cells, const Copy& copy) {
    for (std::uint32_t r = 0; r < tile.code.rows; ++r)
      for (std::uint32_t c = 0; c < tile.code.columns; ++c)
        copy(frame[(tile.row + r) * tile.table->size_.width + tile.column + c],
             cells[r * tile.code.columns + c]);
  }
  static void begin(void* context, void* state, std::uint32_t tick) {
    Tile& tile = *static_cast<Tile*>(context);
    const Table& table = *tile.table;
    for (std::size_t i = 0; i < tile.code.members.size(); ++i) {
      if (!tile.code.members[i].starts_with("sense_")) continue;
      Cells frame = sensor_frame(tile.code.members[i].substr(6), tick,
                                 std::size_t{table.size_.width} * table.size_.height, table.seed_);
      with_cells(tile, frame, tile.code.channel(state, static_cast<int>(i)),
                 [](float& from, float& to) { to = from; });
    }
    tile.code.clock(state, tick, kPeriod * tick, kPeriod);
  }
  static void end(void* context, void* state, std::uint32_t tick) {
    Tile& tile = *static_cast<Tile*>(context);
    Table& table = *tile.table;
    if (tick >= table.frames_.size()) return;
    for (std::size_t i = 0; i < tile.code.members.size(); ++i) {
      if (!tile.code.members[i].starts_with("actuate_")) continue;
      Cells& frame = table.frames_[tick][tile.code.members[i].substr(8)];
      frame.resize(std::size_t{table.size_.width} * table.size_.height);
      with_cells(tile, frame, tile.code.channel(state, static_cast<int>(i)),
                 [](float& to, float& from) { to = from; });
    }
  }
  static int send(void* context, int side, std::uint16_t round, const std::uint8_t* bytes,
                  std::uint16_t count) {
    Tile& tile = *static_cast<Tile*>(context);
    Tile* const to = tile.neighbours[static_cast<std::size_t>(side)];
    EXPECT_NE(to, nullptr);
    if (tile.table->rng_() % 3 == 0) return kNotYet;
    to->inbox[static_cast<std::size_t>(side ^ 1)].push_back({tile.tick, round, {bytes, bytes + count}});
    return kReady;
  }
  static int receive(void* context, int side, std::uint16_t round, std::uint8_t* buffer,
                     std::uint16_t count) {
    Tile& tile = *static_cast<Tile*>(context);
    std::deque<Message>& inbox = tile.inbox[static_cast<std::size_t>(side)];
    if (inbox.empty() || tile.table->rng_() % 4 == 0) return kNotYet;
    const Message message = inbox.front();
    inbox.pop_front();
    EXPECT_EQ(message.tick, tile.tick);
    EXPECT_EQ(message.round, round);
    EXPECT_EQ(message.bytes.size(), count);
    std::copy_n(message.bytes.begin(), std::min<std::size_t>(count, message.bytes.size()), buffer);
    return kReady;
  }

  const Size size_;
  const unsigned seed_;
  std::mt19937 rng_;
  std::vector<std::unique_ptr<Tile>> tiles_;
  std::vector<std::map<std::string, Cells>> frames_;
};

// ---- random programs ----

std::vector<std::uint32_t> cut(std::uint32_t cells, std::uint32_t halo, std::mt19937& rng) {
  // At most two sizes, so that few tiles are compiled.
  std::vector<std::uint32_t> sizes{cells};
  if (cells < 2 * halo || rng() % 4 == 0) return sizes;
  const std::uint32_t first = halo + rng() % std::min(cells - 2 * halo + 1, 6U);
  sizes.clear();
  while (cells >= first + halo && sizes.size() < 3) {
    sizes.push_back(first);
    cells -= first;
  }
  sizes.push_back(cells);
  return sizes;
}

Split random_split(Size size, std::mt19937& rng) {
  Split split;
  split.halo = 1 + (rng() % 2) * (rng() % 4);
  split.widths = cut(size.width, split.halo, rng);
  split.heights = cut(size.height, split.halo, rng);
  static const std::uint32_t kUnroll[] = {20000, 20000, 1, 40};
  split.unroll = kUnroll[rng() % std::size(kUnroll)];
  return split;
}

struct Case {
  unsigned seed = 0;
  Size size{};
  program::Program program;
  Split split;
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::string> names;
};

void generate_tiles(Case& made, Library& library) {
  for (const std::uint32_t width : made.split.widths) {
    for (const std::uint32_t height : made.split.heights) {
      if (made.names.count({width, height}) != 0) continue;
      target_c::Options options;
      options.name =
          "p" + std::to_string(made.seed) + "_" + std::to_string(width) + "_" + std::to_string(height);
      options.columns = made.size.width;
      options.rows = made.size.height;
      options.tile_columns = width;
      options.tile_rows = height;
      options.halo = made.split.halo;
      options.unroll = made.split.unroll;
      library.add(options, target_c::generate(made.program, options, options.name + ".h"));
      made.names[{width, height}] = options.name;
    }
  }
}

Case make_case(unsigned seed, Library& library) {
  static const Size kShapes[] = {{9, 7}, {1, 1}, {3, 5}, {12, 12}, {17, 6}, {1, 9}, {8, 2}, {10, 16}};
  Case made;
  made.seed = seed;
  made.size = kShapes[seed % std::size(kShapes)];
  made.program = RandomProgram(seed, made.size, seed % 3 == 0 ? Reach::kLocal : Reach::kLocalTyped).finish();
  EXPECT_EQ(program::verify(made.program), "") << seed;
  std::mt19937 rng(seed);
  made.split = random_split(made.size, rng);
  generate_tiles(made, library);
  return made;
}

void check_case(const Case& one, const Library& library) {
  SurfaceFrames host(std::size_t{one.size.width} * one.size.height, one.seed);
  Vm vm(one.program, {}, host);
  Status status = Status::kTick;
  for (int tick = 0; tick < kTicks && status == Status::kTick;)
    if (status = vm.run(2'000'000); status == Status::kTick) ++tick;
  ASSERT_EQ(status, Status::kTick) << one.seed << " " << vm.error();
  std::map<std::pair<std::uint32_t, std::uint32_t>, TileCode> codes;
  for (const auto& [size, name] : one.names) codes[size] = library.find(name, size.first, size.second);
  const auto frames = Table(one.size, one.split, codes, one.seed).run(kTicks);
  for (std::size_t tick = 0; tick < kTicks; ++tick) {
    for (const auto& [channel, want] : host.frames[tick]) {
      const auto got = frames[tick].find(channel);
      ASSERT_NE(got, frames[tick].end()) << one.seed << " " << channel;
      for (std::size_t i = 0; i < want.size(); ++i)
        ASSERT_TRUE(bits_equal(want[i], got->second[i]))
            << "seed " << one.seed << " tick " << tick << " channel " << channel << " column "
            << i % one.size.width << " row " << i / one.size.width << ": " << got->second[i] << ", not "
            << want[i] << "; halo " << one.split.halo << ", tiles " << one.split.widths.size() << "x"
            << one.split.heights.size() << ", unroll " << one.split.unroll;
    }
  }
}

TEST(TargetC, RandomProgramsOnRandomTilesMatchTheVm) {
  constexpr std::size_t kBatch = 16;
  const auto seeds = program_seeds(kBatch);
  for (std::size_t begin = 0; begin < seeds.size(); begin += kBatch) {
    Library library;
    std::vector<Case> cases;
    for (const unsigned seed : seeds | std::views::drop(begin) | std::views::take(kBatch))
      cases.push_back(make_case(seed, library));
    ASSERT_TRUE(library.build());
    for (const Case& one : cases) {
      check_case(one, library);
      if (HasFatalFailure()) return;
    }
  }
  count_cases(seeds.size());
}

// Filters in a row that read at one corner: each halo brings the cells beyond it.
TEST(TargetC, TilesReadBeyondEachCorner) {
  Library library;
  std::vector<Case> cases;
  for (const std::uint32_t halo : {1U, 4U})
    for (const std::size_t corner : {0U, 2U, 6U, 8U}) {
      Case made;
      made.seed = static_cast<unsigned>(cases.size());
      made.size = {13, 11};
      made.split.halo = halo;
      made.split.widths = {6, 7};
      made.split.heights = {5, 6};
      TestProgram build;
      const Operand a = build.reg(made.size.width, made.size.height);
      const std::size_t top = build.next_index();
      build.program.filters.push_back({"f", 3, 3, {0, 0, 0, 0, 1, 0, 0, 0, 0}});
      build.program.filters[0].coefficients[corner] = 0.5F;
      build.add(Opcode::kSurfaceSense, a, build.text("numbers"));
      for (int k = 0; k < 4; ++k) build.add(Opcode::kFilterDo, a, a, {OperandKind::kFilter, 0});
      build.add(Opcode::kSurfaceActuate, {}, build.text("y"), a);
      build.add(Opcode::kSurfaceStep);
      build.add(Opcode::kJump, {}, TestProgram::label(top));
      made.program = build.finish();
      generate_tiles(made, library);
      cases.push_back(std::move(made));
    }
  ASSERT_TRUE(library.build());
  for (const Case& one : cases) {
    check_case(one, library);
    if (HasFatalFailure()) return;
  }
}

// Checks a program on a surface that is one tile.
void check_as_one_tile(Case& one) {
  one.split.widths = {one.size.width};
  one.split.heights = {one.size.height};
  Library library;
  generate_tiles(one, library);
  ASSERT_TRUE(library.build());
  check_case(one, library);
}

// Every element-wise instruction on floats of every size, and the functions on angles that are reduced
// exactly.
TEST(TargetC, ElementwiseInstructionsMatchTheVmForAllFloats) {
  constexpr Size kSize{61, 67};
  TestProgram build;
  const Operand a = build.reg(kSize.width, kSize.height), b = build.reg(kSize.width, kSize.height),
                y = build.reg(kSize.width, kSize.height);
  const std::size_t top = build.next_index();
  build.add(Opcode::kSurfaceSense, a, build.text("bits"));
  build.add(Opcode::kSurfaceSense, b, build.text("numbers"));
  int channel = 0;
  for (auto op = static_cast<int>(Opcode::kCopy); op <= static_cast<int>(Opcode::kRound); ++op) {
    if (program::takes_only_integers(static_cast<Opcode>(op))) continue;
    const std::size_t arity = program::opcode_info(static_cast<Opcode>(op)).signature.size() - 1;
    for (const auto& [first, second] : {std::pair{a, b}, {b, a}}) {
      build.add(static_cast<Opcode>(op), y, first, arity > 1 ? second : Operand{},
                arity > 2 ? first : Operand{});
      build.add(Opcode::kSurfaceActuate, {}, build.text("y" + std::to_string(channel++)), y);
    }
  }
  build.add(Opcode::kSurfaceStep);
  build.add(Opcode::kJump, {}, TestProgram::label(top));
  Case one;
  one.seed = 3 + 3 * first_program_seed();  // numbers are random_cells()
  one.size = kSize;
  one.program = build.finish();
  check_as_one_tile(one);
  count_cases(static_cast<std::size_t>(channel) * kSize.width * kSize.height * kTicks);
}

// Every instruction on integers, on cells of all bits, the least and the largest values, and distances.
TEST(TargetC, ElementwiseInstructionsMatchTheVmForIntegers) {
  constexpr Size kSize{37, 23};
  TestProgram build;
  const auto make = [&](program::CellType type) {
    const Operand made = build.reg(kSize.width, kSize.height);
    build.program.registers.back().type = type;
    return made;
  };
  const auto whole = [&](double value) {
    const Operand made = build.lit(0.0F);
    build.program.literals[made.index] = value;
    return made;
  };
  const Operand x = make(program::CellType::kFloat32), numbers = make(program::CellType::kFloat32),
                floats = make(program::CellType::kFloat32);
  const std::size_t top = build.next_index();
  build.add(Opcode::kCellX, x);
  build.add(Opcode::kSurfaceSense, numbers, build.text("numbers"));
  build.add(Opcode::kSurfaceSense, floats, build.text("bits"));
  int channel = 0;
  const auto show = [&](const Operand& y) {
    build.add(Opcode::kSurfaceActuate, {}, build.text("y" + std::to_string(channel++)), y);
  };
  for (const auto type : {program::CellType::kUint8, program::CellType::kUint16, program::CellType::kInt32}) {
    const Operand a = make(type), b = make(type), c = make(type), y = make(type);
    build.add(Opcode::kConvert, a, x);
    build.add(Opcode::kConvert, c, floats);  // mostly the type's limits and 0
    build.add(Opcode::kConvert, b, numbers);
    for (int k = 0; k < 5; ++k) {  // a row of sums that wrap
      build.add(Opcode::kMul, a, a, build.lit(type == program::CellType::kInt32 ? 1664525.0F : 77.0F));
      build.add(Opcode::kAdd, a, a, b);
    }
    for (unsigned i = 0; i <= static_cast<unsigned>(Opcode::kSubSaturated); ++i) {
      const auto op = static_cast<Opcode>(i);
      if (!program::takes_integers(op)) continue;
      const std::size_t arity = program::opcode_info(op).signature.size() - 1;
      for (const auto& [first, second] : {std::pair{a, b}, {a, c}, {c, a}, {c, build.lit(3)}}) {
        build.add(op, y, first, arity > 1 ? second : Operand{}, arity > 2 ? b : Operand{});
        show(y);
      }
    }
    build.program.filters.push_back({"f", 3, 2, {-1, 2, 0, 255, -70000, 3}});
    build.add(Opcode::kFilterDo, y, a,
              Operand{OperandKind::kFilter, static_cast<std::uint32_t>(build.program.filters.size() - 1)});
    show(y);
    // Whole numbers that floats would round.
    const Operand drawn = build.var();
    build.add(Opcode::kRandomInt, y, whole(-3), whole(program::highest_cell(type)));
    build.add(Opcode::kBitAnd, y, y, whole(255));
    show(y);
    build.add(Opcode::kRandomInt, drawn, whole(2e15 + 1), whole(2e15 + 200));
    build.add(Opcode::kSub, drawn, drawn, whole(2e15 + 1));
    build.add(Opcode::kAdd, y, a, drawn);
    show(y);
    for (const auto to : {program::CellType::kUint8, program::CellType::kUint16, program::CellType::kInt32})
      for (const Opcode op : {Opcode::kConvert, Opcode::kConvertSaturated}) {
        if (to == type) continue;
        const Operand other = make(to);
        build.add(op, other, a);
        show(other);
      }
    show(a);
  }
  build.add(Opcode::kSurfaceStep);
  build.add(Opcode::kJump, {}, TestProgram::label(top));
  Case one;
  one.seed = 4 + 3 * first_program_seed();
  one.size = kSize;
  one.program = build.finish();
  EXPECT_EQ(program::verify(one.program), "");
  check_as_one_tile(one);
  count_cases(static_cast<std::size_t>(channel) * kSize.width * kSize.height * kTicks);
}

// In the third tick the step of the `for` is 0, and the rounds of the `repeat` are infinite.
TEST(TargetC, ALoopWithoutAnEndStopsTheBoardWhereItStopsTheVm) {
  for (const auto& [op, what] :
       {std::pair<Opcode, std::string>{Opcode::kCheckFor,
                                       "'for' counts from -9007199254740991 to 9007199254740991 at most, in "
                                       "steps that are not 0"},
        {Opcode::kCheckRepeat, "'repeat' counts up to 9007199254740991 at most"}}) {
    TestProgram build;
    const Operand a = build.reg(4, 3), n = build.var();
    const std::size_t top = build.next_index();
    build.add(Opcode::kSurfaceTime, n);
    build.add(Opcode::kSub, n, n, build.lit(static_cast<float>(2 * kPeriod)));
    if (op == Opcode::kCheckFor) {
      build.add(op, {}, build.lit(0), build.lit(9), n);
    } else {
      build.add(Opcode::kDiv, n, build.lit(1), n);
      build.add(op, {}, n);
    }
    build.add(Opcode::kSurfaceActuate, {}, build.text("y"), a);
    build.add(Opcode::kSurfaceStep);
    build.add(Opcode::kJump, {}, TestProgram::label(top));
    Case one;
    one.size = {4, 3};
    one.program = build.finish();
    ASSERT_EQ(program::verify(one.program), "");
    SurfaceFrames host(12, 0);
    Vm vm(one.program, {}, host);
    EXPECT_EQ(vm.run(), Status::kTick);
    EXPECT_EQ(vm.run(), Status::kTick);
    EXPECT_EQ(vm.run(), Status::kFailed);
    one.split.widths = {4};
    one.split.heights = {3};
    Library library;
    generate_tiles(one, library);
    ASSERT_TRUE(library.build());
    TileCode code = library.find(one.names.at({4, 3}), 4, 3);
    std::vector<double> memory(code.size() / sizeof(double) + 1);
    const Links links{&code,
                      [](void* context, void* state, std::uint32_t tick) {
                        static_cast<TileCode*>(context)->clock(state, tick, kPeriod * tick, kPeriod);
                      },
                      nullptr, nullptr, [](void*, void*, std::uint32_t) {}};
    ASSERT_EQ(code.init(memory.data(), &links, 0, 0, 3, 4), 0);
    EXPECT_EQ(code.run(memory.data()), kDone);
    EXPECT_EQ(code.run(memory.data()), kDone);
    EXPECT_STREQ(code.error(memory.data()), "");
    EXPECT_EQ(code.run(memory.data()), kFailed);
    EXPECT_EQ(code.run(memory.data()), kFailed);
    EXPECT_EQ(code.error(memory.data()),
              "test.aps:" + std::to_string(op == Opcode::kCheckFor ? 3 : 4) + ": error: " + what);
  }
}

// The centre cell of 3x3 takes the west neighbour's number so often a tick, and shows it. Each edge has 100
// times its tick and its round, and one never comes. The first tick is left out.
std::vector<float> shown_without_edge(bool counts_ticks, std::uint32_t unroll, std::uint32_t lost_tick,
                                      std::uint16_t lost_round) {
  TestProgram build;
  const Operand a = build.reg(3, 3), b = build.reg(3, 3), n = build.var();
  build.add(Opcode::kCopy, a, build.lit(0.5F));
  const std::size_t top = build.next_index();
  if (counts_ticks)
    build.add(Opcode::kSurfaceTick, n);
  else
    build.add(Opcode::kCopy, n, build.lit(3));
  const std::size_t pass = build.next_index();
  build.add(Opcode::kShift, b, a, build.lit(1), build.lit(0));
  build.add(Opcode::kCopy, a, b);
  build.add(Opcode::kSub, n, n, build.lit(1));
  build.add(Opcode::kJumpGt, {}, n, build.lit(0), TestProgram::label(pass));
  build.add(Opcode::kSurfaceActuate, {}, build.text("y"), a);
  build.add(Opcode::kSurfaceStep);
  build.add(Opcode::kJump, {}, TestProgram::label(top));
  target_c::Options options;
  options.name = "p";
  options.columns = options.rows = 3;
  options.tile_columns = options.tile_rows = 1;
  options.unroll = unroll;
  const program::Program program = build.finish();
  EXPECT_EQ(program::verify(program), "");
  Library library;
  library.add(options, target_c::generate(program, options, "p.h"));
  EXPECT_TRUE(library.build());
  struct Board {
    TileCode code;
    std::uint32_t tick = 0, lost_tick = 0;
    std::uint16_t lost_round = 0;
  } board{library.find("p", 1, 1), 0, lost_tick, lost_round};
  const Links links{
      &board,
      [](void* context, void* state, std::uint32_t tick) {
        Board& of = *static_cast<Board*>(context);
        of.tick = tick;
        of.code.clock(state, tick, kPeriod * tick, kPeriod);
      },
      [](void*, int, std::uint16_t, const std::uint8_t*, std::uint16_t) -> int { return kReady; },
      [](void* context, int, std::uint16_t round, std::uint8_t* buffer, std::uint16_t count) -> int {
        const Board& of = *static_cast<Board*>(context);
        if (of.tick == of.lost_tick && round == of.lost_round) return kGivenUp;
        const auto value = static_cast<float>(100 * of.tick + round);
        std::memcpy(buffer, &value, std::min<std::size_t>(count, sizeof value));
        return kReady;
      },
      [](void*, void*, std::uint32_t) {}};
  std::vector<double> memory(board.code.size() / sizeof(double) + 1);
  EXPECT_EQ(board.code.init(memory.data(), &links, 1, 1, 3, 3), 0);
  std::vector<float> shown;
  for (int tick = 0; tick < 5; ++tick) {
    EXPECT_EQ(board.code.run(memory.data()), kDone);
    if (tick > 0) shown.push_back(*board.code.channel(memory.data(), 0));
  }
  return shown;
}

TEST(TargetC, AnEdgeThatIsGivenUpIsThePreviousTicksHoweverFarLoopsAreUnrolled) {
  for (const std::uint32_t unroll : {20000U, 6U, 1U})
    EXPECT_EQ(shown_without_edge(false, unroll, 3, 2), (std::vector<float>{102, 202, 202, 402})) << unroll;
}

TEST(TargetC, AnEdgeThatIsGivenUpInALoopOfUnknownLengthIsThePreviousPasss) {
  EXPECT_EQ(shown_without_edge(true, 20000, 4, 3), (std::vector<float>{100, 201, 302, 402}));
}

TEST(TargetC, SaysWhatAnIntegerCannotHold) {
  TestProgram build;
  const Operand a = build.reg(64, 64), n = build.var(300.0F);
  build.program.registers.back().type = program::CellType::kUint8;
  build.add(Opcode::kCopy, a, n);
  build.add(Opcode::kSurfaceActuate, {}, build.text("y"), a);
  build.add(Opcode::kSurfaceStep);
  EXPECT_EQ(target_c::generate(build.finish(), {}, "program.h").warnings,
            std::vector<std::string>{
                "test.aps:1: warning: 300 is no uint8: a board limits it to the type's values"});
}

// A program whose C has all parts: edges, mathematics, integers, random numbers and scalars of run time.
program::Program program_of_all_parts() {
  TestProgram build;
  const Operand a = build.reg(8, 8), b = build.reg(8, 8), i = build.reg(8, 8), j = build.reg(8, 8),
                n = build.var();
  for (const Operand& whole : {i, j}) build.program.registers[whole.index].type = program::CellType::kInt32;
  const std::size_t top = build.next_index();
  build.add(Opcode::kSurfaceTime, n);
  build.add(Opcode::kSurfaceSense, a, build.text("program_y"));
  build.add(Opcode::kNearSum, b, a, build.lit(8));
  build.add(Opcode::kSin, a, b);
  build.add(Opcode::kRandomInt, i, build.lit(0), n);
  build.add(Opcode::kNearMax, j, i, build.lit(4));
  build.add(Opcode::kMul, a, a, n);
  build.add(Opcode::kCheckRepeat, {}, n);
  build.add(Opcode::kSurfaceActuate, {}, build.text("program_y"), a);
  build.add(Opcode::kSurfaceActuate, {}, build.text("i"), j);
  build.add(Opcode::kSurfaceStep);
  build.add(Opcode::kJump, {}, TestProgram::label(top));
  program::Program program = build.finish();
  EXPECT_EQ(program::verify(program), "");
  program.files = {"program_PROGRAM_.aps"};
  return program;
}

std::set<std::string> identifiers(std::string text) {
  for (std::size_t at = text.find("/*"); at != std::string::npos; at = text.find("/*", at))
    text.erase(at, text.find("*/", at) + 2 - at);
  static const std::regex kIdentifier("[A-Za-z_]\\w*");
  return {std::sregex_token_iterator(text.begin(), text.end(), kIdentifier), {}};
}

TEST(TargetC, AnyNameMakesCThatCompiles) {
  target_c::Options options;
  options.columns = options.rows = 8;
  options.tile_columns = options.tile_rows = 4;
  const program::Program program = program_of_all_parts();
  const target_c::Generated plain = target_c::generate(program, options, "program.h");
  // No identifier becomes a public one when the prefix of those changes.
  const std::set<std::string> all = identifiers(plain.source + plain.header);
  for (const std::string& name : all) {
    if (!name.starts_with("program_") && !name.starts_with("PROGRAM_")) continue;
    for (const std::string& other : all) {
      if (other.ends_with(name.substr(7)) && other.find("program_") != 0 && other.find("PROGRAM_") != 0)
        ADD_FAILURE() << other << " is " << name << " of another prefix";
    }
  }
  Library library;
  for (const char* const name : {"int", "exit", "table", "west_and", "_8x8", "PROGRAM_x"}) {
    options.name = name;
    const target_c::Generated made = target_c::generate(program, options, options.name + ".h");
    EXPECT_NE(made.header.find(" sense_program_y["), std::string::npos) << name;
    EXPECT_NE(made.header.find("/* program_y */"), std::string::npos) << name;
    EXPECT_NE(made.source.find("return \"program_PROGRAM_.aps:8: error: "), std::string::npos) << name;
    library.add(options, made);
  }
  EXPECT_TRUE(library.build());
}

// ---- the programs of the tasks ----

program::Program compile_script(const std::string& file, Size size) {
  compiler::CompileOptions options;
  options.file = file;
  options.width = size.width;
  options.height = size.height;
  options.library_path = APRON_SCRIPTS "/apron";
  syntax::DiskReader reader;
  compiler::CompileResult result = compiler::compile(options, reader);
  EXPECT_TRUE(result.program) << file;
  return result.program ? *result.program : program::Program{};
}

TEST(TargetC, LocalTasksOnTilesMatchTheVm) {
  Library library;
  std::vector<Case> cases;
  std::vector<std::string> files;
  for (const char* const folder : {"/case-study", "/tasks", "/examples"})
    for (const auto& entry : fs::directory_iterator(std::string(APRON_SCRIPTS) + folder))
      if (entry.path().extension() == ".aps") files.push_back(entry.path().string());
  std::ranges::sort(files);
  for (const std::string& file : files) {
    Case made;
    made.seed = static_cast<unsigned>(cases.size());
    made.size = {24, 19};
    made.program = compile_script(file, made.size);
    if (!program::find_nonlocal_instructions(made.program).empty()) continue;
    if (!program::can_reach(made.program, Opcode::kSurfaceStep)) continue;
    std::mt19937 rng(made.seed);
    made.split = random_split(made.size, rng);
    generate_tiles(made, library);
    cases.push_back(std::move(made));
  }
  EXPECT_GE(cases.size(), 25U);
  ASSERT_TRUE(library.build());
  for (const Case& one : cases) {
    check_case(one, library);
    if (HasFatalFailure()) return;
  }
}

}  // namespace
}  // namespace apron::vm::test
