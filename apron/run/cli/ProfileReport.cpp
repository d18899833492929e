#include "apron/run/cli/ProfileReport.h"

#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>

namespace apron::run {
namespace {

using nlohmann::ordered_json;

// An invalid model; text is for the user.
struct CostModelError {
  std::string text;
};

double read_number(const ordered_json& object, const char* field, double default_value,
                   const std::string& where) {
  if (!object.contains(field)) return default_value;
  const ordered_json& value = object.at(field);
  const double v = value.is_number() ? value.get<double>() : -1.0;
  if (!(v >= 0.0) || !std::isfinite(v))
    throw CostModelError{where + ": '" + field + "' is " + value.dump() +
                         ", but must be a non-negative number"};
  return v;
}

void require_known_fields(const ordered_json& object, std::initializer_list<std::string_view> fields,
                          const std::string& where) {
  if (!object.is_object()) throw CostModelError{where + ": must be an object { … }"};
  std::string known;
  for (const std::string_view field : fields) known += (known.empty() ? "" : ", ") + std::string(field);
  for (const auto& [key, value] : object.items())
    if (std::find(fields.begin(), fields.end(), key) == fields.end())
      throw CostModelError{where + ": '" + key + "' is unknown; known: " + known};
}

InstructionCost parse_cost(const ordered_json& object, const std::string& where) {
  require_known_fields(object, {"cycles", "cycles_per_cell", "energy_j", "energy_j_per_cell"}, where);
  return {read_number(object, "cycles", 1.0, where), read_number(object, "cycles_per_cell", 0.0, where),
          read_number(object, "energy_j", 0.0, where), read_number(object, "energy_j_per_cell", 0.0, where)};
}

bool is_mnemonic(const std::string& name) {
  for (std::size_t op = 0; op < program::opcode_count(); ++op)
    if (program::opcode_info(static_cast<program::Opcode>(op)).mnemonic == name) return true;
  return false;
}

CostModel parse_model(const ordered_json& object) {
  require_known_fields(object, {"name", "clock_hz", "idle_w", "default", "instructions"}, "the model");
  CostModel model;
  if (object.contains("name") && object["name"].is_string()) model.name = object["name"].get<std::string>();
  model.clock_hz = read_number(object, "clock_hz", 0.0, "the model");
  if (!(model.clock_hz > 0.0))
    throw CostModelError{"the model: 'clock_hz' must be positive (cycles per second)"};
  model.idle_w = read_number(object, "idle_w", 0.0, "the model");
  if (object.contains("default")) model.default_cost = parse_cost(object["default"], "'default'");
  if (!object.contains("instructions")) return model;
  if (!object["instructions"].is_object()) throw CostModelError{"'instructions': must be an object { … }"};
  for (const auto& [name, value] : object["instructions"].items()) {
    if (!is_mnemonic(name))
      throw CostModelError{"'instructions': there is no instruction '" + name +
                           "'; apron disasm lists those of a program"};
    model.instructions[name] = parse_cost(value, "'" + name + "'");
  }
  return model;
}

struct ProfileTotals {
  std::uint64_t count = 0, nanoseconds = 0;
  double cycles = 0.0, energy_j = 0.0;

  ProfileTotals& operator+=(const ProfileTotals& other) {
    count += other.count;
    nanoseconds += other.nanoseconds;
    cycles += other.cycles;
    energy_j += other.energy_j;
    return *this;
  }
  void write_json(ordered_json& json, bool with_model) const {
    json["count"] = count;
    json["time_ns"] = nanoseconds;
    if (!with_model) return;
    json["cycles"] = cycles;
    json["energy_j"] = energy_j;
  }
};

// The cells of the instruction's destination register, or else of its first register operand; 0 without one.
double cell_count(const program::Program& program, const program::Instruction& instruction) {
  const auto of = [&](const program::Operand& o) {
    const program::Register& reg = program.registers[o.index];
    return static_cast<double>(reg.width) * reg.height;
  };
  if (instruction.destination.kind == program::OperandKind::kRegister) return of(instruction.destination);
  for (const program::Operand& operand : instruction.operands)
    if (operand.kind == program::OperandKind::kRegister) return of(operand);
  return 0.0;
}

ProfileTotals instruction_totals(const program::Program& program, std::size_t index,
                                 const vm::InstructionProfile& profile,
                                 const std::optional<CostModel>& model) {
  ProfileTotals totals{profile.executions, profile.nanoseconds, 0.0, 0.0};
  if (!model) return totals;
  const program::Instruction& instruction = program.code[index];
  const auto found = model->instructions.find(std::string(program::opcode_info(instruction.op).mnemonic));
  const InstructionCost& cost = found != model->instructions.end() ? found->second : model->default_cost;
  const auto executions = static_cast<double>(profile.executions);
  totals.cycles = executions * (cost.cycles + cost.cycles_per_cell * cell_count(program, instruction));
  totals.energy_j = executions * (cost.energy_j + cost.energy_j_per_cell * cell_count(program, instruction));
  return totals;
}

ordered_json estimate_json(const ProfileTotals& total, std::uint64_t frame_count, const CostModel& model) {
  ordered_json json;
  const double time_s = total.cycles / model.clock_hz, energy_j = total.energy_j + model.idle_w * time_s;
  json["model"] = model.name;
  json["cycles"] = total.cycles;
  json["time_s"] = time_s;
  json["energy_j"] = energy_j;
  if (frame_count == 0) return json;
  const auto frames = static_cast<double>(frame_count);
  json["per_frame"] = {
      {"cycles", total.cycles / frames}, {"time_s", time_s / frames}, {"energy_j", energy_j / frames}};
  return json;
}

}  // namespace

std::optional<CostModel> read_cost_model(const std::string& file, std::string& error) {
  std::ifstream in(file);
  if (!in) {
    error = file + ": error: cannot be read";
    return std::nullopt;
  }
  try {
    return parse_model(ordered_json::parse(in, nullptr, true, true));
  } catch (const CostModelError& model_error) {
    error = file + ": error: " + model_error.text;
  } catch (const nlohmann::json::exception& json_error) {
    error = file + ": error: not JSON: " + json_error.what();
  }
  return std::nullopt;
}

std::string profile_json(const program::Program& program, const std::vector<vm::InstructionProfile>& profile,
                         std::uint64_t frame_count, const std::optional<CostModel>& model) {
  std::map<std::string, ProfileTotals> by_name;
  std::map<std::pair<std::uint32_t, std::uint32_t>, ProfileTotals> by_line;
  ProfileTotals total;
  ordered_json instructions = ordered_json::array();
  for (std::size_t index = 0; index < profile.size(); ++index) {
    if (profile[index].executions == 0) continue;
    const ProfileTotals sum = instruction_totals(program, index, profile[index], model);
    const program::SourceLocation& source = program.source_locations[program.code[index].source_location];
    total += sum;
    by_name[std::string(program::opcode_info(program.code[index].op).mnemonic)] += sum;
    by_line[{source.file, source.line}] += sum;
    ordered_json& entry = instructions.emplace_back();
    entry["index"] = index;
    entry["instruction"] = program::opcode_info(program.code[index].op).mnemonic;
    entry["file"] = program.files[source.file];
    entry["line"] = source.line;
    sum.write_json(entry, model.has_value());
  }
  ordered_json report;
  report["how"] = "one instruction at a time; without --profile instructions run together and faster";
  report["frames"] = frame_count;
  total.write_json(report["all"], model.has_value());
  if (model) report["estimate"] = estimate_json(total, frame_count, *model);
  for (const auto& [name, sum] : by_name) sum.write_json(report["instructions"][name], model.has_value());
  for (const auto& [place, sum] : by_line) {
    ordered_json& line = report["lines"].emplace_back();
    line["file"] = program.files[place.first];
    line["line"] = place.second;
    sum.write_json(line, model.has_value());
  }
  report["program"] = std::move(instructions);
  return report.dump(1) + "\n";
}

}  // namespace apron::run
