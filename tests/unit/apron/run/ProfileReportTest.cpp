// Profile counts, sums and estimates, and the messages for invalid cost models.
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "apron/run/cli/ProfileReport.h"
#include "tests/unit/apron/vm/TestProgram.h"

namespace apron::run {
namespace {

using nlohmann::json;
using program::Opcode;
using program::Operand;
using vm::test::TestProgram;

// Lines 2 to 4 loop three times, and line 5 ends the program. The register has 4x2 cells.
TestProgram loop_program() {
  TestProgram b;
  const Operand a = b.reg(4, 2), i = b.var(3);
  b.add(Opcode::kCopy, a, b.lit(1));
  b.add(Opcode::kAdd, a, a, b.lit(1));
  b.add(Opcode::kSub, i, i, b.lit(1));
  b.add(Opcode::kJumpGt, {}, i, b.lit(0), TestProgram::label(1));
  return b;
}

json profile(const std::optional<CostModel>& model, std::uint64_t steps) {
  vm::test::FakeHost host;
  vm::VmOptions options;
  options.enable_profiling = true;
  vm::Vm vm(loop_program().finish(), options, host);
  EXPECT_EQ(vm.run(), vm::Status::kEnded);
  return json::parse(profile_json(vm.program(), vm.profile(), steps, model));
}

TEST(ProfileReport, CountsByInstructionAndLine) {
  const json p = profile(std::nullopt, 0);
  EXPECT_EQ(p["all"]["count"], 1 + 3 * 3 + 1);
  EXPECT_EQ(p["instructions"]["copy"]["count"], 1);
  EXPECT_EQ(p["instructions"]["add"]["count"], 3);
  EXPECT_EQ(p["instructions"]["jump.gt"]["count"], 3);
  ASSERT_EQ(p["lines"].size(), 5U);
  EXPECT_EQ(p["lines"][1]["line"], 2);
  EXPECT_EQ(p["lines"][1]["count"], 3);
  EXPECT_EQ(p["program"][2]["instruction"], "sub");
  EXPECT_FALSE(p.contains("estimate"));
  std::uint64_t ns = 0;
  for (const json& one : p["program"]) ns += one["time_ns"].get<std::uint64_t>();
  EXPECT_EQ(p["all"]["time_ns"], ns);
}

TEST(ProfileReport, EstimatesCostFromModel) {
  CostModel model;
  model.clock_hz = 100;
  model.idle_w = 2;
  model.default_cost.cycles = 1;
  model.instructions["add"] = {5, 0.5, 1, 0.25};
  const json p = profile(model, 2);
  // Cycles: 3 adds of 5 + 0.5 * 8, and 8 others of 1. Energy: 3 * (1 + 0.25 * 8) J, and 2 W for 0.35 s.
  EXPECT_DOUBLE_EQ(p["estimate"]["cycles"], 35.0);
  EXPECT_DOUBLE_EQ(p["estimate"]["time_s"], 0.35);
  EXPECT_DOUBLE_EQ(p["estimate"]["energy_j"], 9.7);
  EXPECT_DOUBLE_EQ(p["estimate"]["per_frame"]["cycles"], 17.5);
  EXPECT_DOUBLE_EQ(p["lines"][1]["cycles"], 27.0);
}

// Two expansions of the priced macro "add": one of two instructions, of which one is in a nested expansion of
// another priced macro, executed three times; one of one instruction, executed once.
TEST(ProfileReport, BillsMacrosAsInstructionsOfTheMachine) {
  program::Program program = loop_program().finish();
  program.files = {"f"};
  program.expansions = {{}, {"add", {}}, {"write", {0, 1, 1, 1}}, {"add", {}}};
  program.source_locations = {{0, 1, 1, 3}, {0, 2, 1, 1}, {0, 3, 1, 2}, {0, 4, 1, 0}, {0, 5, 1, 0}};
  for (std::uint32_t i = 0; i < program.code.size(); ++i) program.code[i].source_location = i;
  std::vector<vm::InstructionProfile> profile(program.code.size());
  const std::uint64_t executions[] = {1, 3, 3, 3, 1};
  for (std::size_t i = 0; i < profile.size(); ++i) profile[i].executions = executions[i];
  CostModel model;
  model.clock_hz = 10;
  model.default_cost.cycles = 0;
  model.macros = {{"add", {2, 0, 0, 0.5}}, {"write", {100, 0, 0, 100}}};
  model.frame_macros = {"add"};
  const json p = json::parse(profile_json(program, profile, 0, model));
  EXPECT_EQ(p["machine"]["count"], 4);
  EXPECT_EQ(p["machine"]["instructions"]["add"]["count"], 4);
  EXPECT_FALSE(p["machine"]["instructions"].contains("write"));
  EXPECT_DOUBLE_EQ(p["machine"]["cycles"], 8.0);
  EXPECT_DOUBLE_EQ(p["machine"]["energy_j"], 4 * 8 * 0.5);
  EXPECT_DOUBLE_EQ(p["estimate"]["time_s"], 0.8);
  EXPECT_EQ(p["frames"], 4);
  EXPECT_DOUBLE_EQ(p["estimate"]["per_frame"]["cycles"], 2.0);
}

// A macro whose body loops three times, at its beginning, in a program that uses it twice.
TEST(ProfileReport, BillsAUseOfAMacroOnceHoweverOftenItsBodyLoops) {
  TestProgram b;
  const Operand a = b.reg(4, 2), i = b.var(), n = b.var(2);
  b.add(Opcode::kCopy, i, b.lit(3));
  b.add(Opcode::kAdd, a, a, b.lit(1));
  b.add(Opcode::kSub, i, i, b.lit(1));
  b.add(Opcode::kJumpGt, {}, i, b.lit(0), TestProgram::label(1));
  b.add(Opcode::kSub, n, n, b.lit(1));
  b.add(Opcode::kJumpGt, {}, n, b.lit(0), TestProgram::label(0));
  program::Program program = b.finish();
  program.files = {"f"};
  program.expansions = {{}, {"settle", {}}};
  program.source_locations = {{0, 1, 1, 0}, {0, 2, 1, 1}};
  for (std::uint32_t k = 0; k < program.code.size(); ++k)
    program.code[k].source_location = k >= 1 && k <= 3 ? 1 : 0;
  CostModel model;
  model.clock_hz = 10;
  model.default_cost.cycles = 0;
  model.macros = {{"settle", {5}}};
  model.frame_macros = {"settle"};
  vm::test::FakeHost host;
  vm::VmOptions options;
  options.enable_profiling = true;
  vm::Vm vm(program, options, host);
  ASSERT_EQ(vm.run(), vm::Status::kEnded);
  const json p = json::parse(profile_json(program, vm.profile(), 0, model));
  EXPECT_EQ(p["machine"]["count"], 2);
  EXPECT_EQ(p["frames"], 2);
  EXPECT_DOUBLE_EQ(p["machine"]["cycles"], 10.0);
  EXPECT_EQ(p["program"][1]["count"], 6);
}

TEST(ProfileReport, BillsFormsOfAMacroByTheirOperands) {
  program::Program program = loop_program().finish();
  program.files = {"f"};
  program.expansions = {{}, {"not", {}, 1}, {"not", {}, 2}, {"res", {}, 2}};
  program.source_locations = {{0, 1, 1, 1}, {0, 2, 1, 2}, {0, 3, 1, 3}, {0, 4, 1, 0}, {0, 5, 1, 0}};
  for (std::uint32_t i = 0; i < program.code.size(); ++i) program.code[i].source_location = i;
  std::vector<vm::InstructionProfile> profile(program.code.size());
  for (vm::InstructionProfile& entry : profile) entry.executions = 1;
  CostModel model;
  model.clock_hz = 10;
  model.default_cost.cycles = 0;
  model.macros = {{"not", {1}}, {"not/1", {2}}, {"res/2", {30}}};
  const json p = json::parse(profile_json(program, profile, 0, model));
  EXPECT_EQ(p["machine"]["instructions"]["not"]["count"], 2);
  EXPECT_DOUBLE_EQ(p["machine"]["instructions"]["not"]["cycles"], 3.0);
  EXPECT_DOUBLE_EQ(p["machine"]["cycles"], 33.0);
}

TEST(ProfileReport, ReadsScampModel) {
  std::string error;
  const auto model = read_cost_model(APRON_SCAMP_MODEL, error);
  ASSERT_TRUE(model) << error;
  EXPECT_EQ(model->clock_hz, 1e7);
  EXPECT_EQ(model->macros.at("add").cycles, 2);
  const std::pair<const char*, int> kHeader[] = {
      {"AND", 4},  {"NAND", 4}, {"XOR", 6},  {"MUX", 5}, {"NOT", 1}, {"NOT/1", 2}, {"OR/2", 2},
      {"diva", 5}, {"div", 5},  {"divq", 2}, {"abs", 6}, {"res", 2}, {"res/2", 3}};
  for (const auto& [name, cycles] : kHeader) EXPECT_EQ(model->macros.at(name).cycles, cycles) << name;
  // 535 GOPS/W
  EXPECT_NEAR(model->macros.at("add").energy_j_per_cell * 535e9, 2.0, 0.01);
  EXPECT_EQ(model->default_cost.cycles, 0);
}

TEST(ProfileReport, ReadsExampleModel) {
  std::string error;
  const auto model = read_cost_model(APRON_EXAMPLE_MODEL, error);
  ASSERT_TRUE(model) << error;
  EXPECT_GT(model->clock_hz, 0);
  EXPECT_EQ(model->instructions.at("shift").cycles, 2);
}

TEST(ProfileReport, ReportsInvalidModels) {
  const std::string file = ::testing::TempDir() + "apron_model_" + std::to_string(getpid()) + ".json";
  const std::pair<const char*, const char*> kWrong[] = {
      {"{", "not JSON"},
      {"[]", "an object"},
      {"{}", "clock_hz"},
      {R"({"clock_hz": -1})", "'clock_hz' is -1"},
      {R"({"clock_hz": 1, "clock": 2})", "'clock' is unknown"},
      {R"({"clock_hz": 1, "instructions": {"ad": {}}})", "no instruction 'ad'"},
      {R"({"clock_hz": 1, "instructions": {"add": {"cycles": "two"}}})", "'add': 'cycles' is \"two\""},
      {R"({"clock_hz": 1, "macros": 3})", "'macros': must be an object"},
      {R"({"clock_hz": 1, "macros": {"add": {"cycle": 1}}})", "'add': 'cycle' is unknown"},
      {R"({"clock_hz": 1, "frame_macros": [1]})", "'frame_macros': must be a list"},
      {R"({"clock_hz": 1, "instructions": {"add": 2}})", "'add': must be an object"}};
  for (const auto& [text, what] : kWrong) {
    std::ofstream(file) << text;
    std::string error;
    EXPECT_FALSE(read_cost_model(file, error)) << text;
    EXPECT_NE(error.find(what), std::string::npos) << error;
    EXPECT_EQ(error.find('\n'), std::string::npos) << error;
  }
  std::filesystem::remove(file);
}

}  // namespace
}  // namespace apron::run
