// Programs as C for boards leave the bits of the virtual machine in every actuator frame: random local
// programs, on random splits of the table into tiles, with halos of several widths and messages that come
// late.
#include <gtest/gtest.h>

#include <cstring>
#include <filesystem>
#include <memory>
#include <regex>

#include "apron/compiler/Compiler.h"
#include "apron/program/LocalityCheck.h"
#include "apron/program/Reachability.h"
#include "apron/syntax/FileReader.h"
#include "apron/target_c/TargetC.h"
#include "common/error/UserError.h"
#include "tests/property/apron/RandomProgram.h"
#include "tests/property/apron/TileTable.h"

namespace apron::vm::test {
namespace {

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
                "test.aps:1: warning: 300 is not of type uint8: a board limits it to the type's values"});
}

TEST(TargetC, SaysWhatABoundaryOfIntegersCannotHold) {
  TestProgram build;
  const Operand a = build.reg(64, 64), b = build.reg(64, 64), n = build.var(2.5F);
  for (program::Register& reg : build.program.registers) reg.type = program::CellType::kUint8;
  build.add(Opcode::kBoundary, {}, build.lit(static_cast<float>(program::BoundaryRule::kValue)), n);
  build.add(Opcode::kShift, b, a, build.lit(1), build.lit(0));
  build.add(Opcode::kSurfaceActuate, {}, build.text("y"), b);
  build.add(Opcode::kSurfaceStep);
  EXPECT_EQ(target_c::generate(build.finish(), {}, "program.h").warnings,
            std::vector<std::string>{
                "test.aps:2: warning: 2.5 is not of type uint8: a board limits it to the type's values"});
}

TEST(TargetC, SaysWhatAMemberOfAClassCannotHold) {
  TestProgram build;
  const Operand a = build.reg(64, 64), n = build.var(300.0F);
  build.program.registers.back().type = program::CellType::kUint8;
  build.program.groups.push_back({"r", false, {a.index}});
  build.add(Opcode::kResSetReg, {}, {OperandKind::kGroup, 0}, build.lit(0), n);
  build.add(Opcode::kSurfaceActuate, {}, build.text("y"), a);
  build.add(Opcode::kSurfaceStep);
  EXPECT_EQ(target_c::generate(build.finish(), {}, "program.h").warnings,
            std::vector<std::string>{
                "test.aps:1: warning: 300 is not of type uint8: a board limits it to the type's values"});
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
