#include "apron/run/ProfileFile.h"

#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>

namespace apron::run {
namespace {

using nlohmann::ordered_json;

// What is wrong with a model, for the user.
struct WrongModel {
  std::string text;
};

double number(const ordered_json& object, const char* field, double otherwise, const std::string& where) {
  if (!object.contains(field)) return otherwise;
  const ordered_json& value = object.at(field);
  const double v = value.is_number() ? value.get<double>() : -1.0;
  if (!(v >= 0.0) || !std::isfinite(v))
    throw WrongModel{where + ": '" + field + "' is " + value.dump() +
                     ", and should be a number of at least 0"};
  return v;
}

void only(const ordered_json& object, std::initializer_list<std::string_view> fields,
          const std::string& where) {
  if (!object.is_object()) throw WrongModel{where + ": an object { … } is wanted here"};
  std::string known;
  for (const std::string_view field : fields) known += (known.empty() ? "" : ", ") + std::string(field);
  for (const auto& [key, value] : object.items())
    if (std::find(fields.begin(), fields.end(), key) == fields.end())
      throw WrongModel{where + ": '" + key + "' is unknown; there are " + known};
}

Cost cost(const ordered_json& object, const std::string& where) {
  only(object, {"cycles", "cycles_per_cell", "energy_j", "energy_j_per_cell"}, where);
  return {number(object, "cycles", 1.0, where), number(object, "cycles_per_cell", 0.0, where),
          number(object, "energy_j", 0.0, where), number(object, "energy_j_per_cell", 0.0, where)};
}

bool is_mnemonic(const std::string& name) {
  for (std::size_t op = 0; op < program::opcode_count(); ++op)
    if (program::opcode_info(static_cast<program::Opcode>(op)).mnemonic == name) return true;
  return false;
}

CostModel model(const ordered_json& object) {
  only(object, {"name", "clock_hz", "idle_w", "default", "instructions"}, "the model");
  CostModel model;
  if (object.contains("name") && object["name"].is_string()) model.name = object["name"].get<std::string>();
  model.clock_hz = number(object, "clock_hz", 0.0, "the model");
  if (!(model.clock_hz > 0.0))
    throw WrongModel{"the model: 'clock_hz' must say how many cycles a second has"};
  model.idle_w = number(object, "idle_w", 0.0, "the model");
  if (object.contains("default")) model.otherwise = cost(object["default"], "'default'");
  if (!object.contains("instructions")) return model;
  if (!object["instructions"].is_object()) throw WrongModel{"'instructions': an object { … } is wanted here"};
  for (const auto& [name, value] : object["instructions"].items()) {
    if (!is_mnemonic(name))
      throw WrongModel{"'instructions': there is no instruction '" + name +
                       "'; apron disasm shows a program's"};
    model.instructions[name] = cost(value, "'" + name + "'");
  }
  return model;
}

struct Sum {
  std::uint64_t count = 0, nanoseconds = 0;
  double cycles = 0.0, energy_j = 0.0;

  Sum& operator+=(const Sum& other) {
    count += other.count;
    nanoseconds += other.nanoseconds;
    cycles += other.cycles;
    energy_j += other.energy_j;
    return *this;
  }
  void write(ordered_json& to, bool modelled) const {
    to["count"] = count;
    to["time_ns"] = nanoseconds;
    if (!modelled) return;
    to["cycles"] = cycles;
    to["energy_j"] = energy_j;
  }
};

// Of the register that the instruction writes or else reads; 0 for scalars.
double cells(const program::Program& program, const program::Instruction& in) {
  const auto of = [&](const program::Operand& o) {
    const program::Register& reg = program.registers[o.index];
    return static_cast<double>(reg.width) * reg.height;
  };
  if (in.destination.kind == program::OperandKind::kRegister) return of(in.destination);
  for (const program::Operand& o : in.operands)
    if (o.kind == program::OperandKind::kRegister) return of(o);
  return 0.0;
}

Sum sum_of(const program::Program& program, std::size_t at, const vm::InstructionProfile& spent,
           const std::optional<CostModel>& model) {
  Sum sum{spent.executions, spent.nanoseconds, 0.0, 0.0};
  if (!model) return sum;
  const program::Instruction& in = program.code[at];
  const auto found = model->instructions.find(std::string(program::opcode_info(in.op).mnemonic));
  const Cost& each = found != model->instructions.end() ? found->second : model->otherwise;
  const auto times = static_cast<double>(spent.executions);
  sum.cycles = times * (each.cycles + each.cycles_per_cell * cells(program, in));
  sum.energy_j = times * (each.energy_j + each.energy_j_per_cell * cells(program, in));
  return sum;
}

ordered_json estimate(const Sum& all, std::uint64_t steps, const CostModel& model) {
  ordered_json to;
  const double time_s = all.cycles / model.clock_hz, energy_j = all.energy_j + model.idle_w * time_s;
  to["model"] = model.name;
  to["cycles"] = all.cycles;
  to["time_s"] = time_s;
  to["energy_j"] = energy_j;
  if (steps == 0) return to;
  const auto frames = static_cast<double>(steps);
  to["per_frame"] = {
      {"cycles", all.cycles / frames}, {"time_s", time_s / frames}, {"energy_j", energy_j / frames}};
  return to;
}

}  // namespace

std::optional<CostModel> read_cost_model(const std::string& file, std::string& wrong) {
  std::ifstream in(file);
  if (!in) {
    wrong = file + ": error: cannot be read";
    return std::nullopt;
  }
  try {
    return model(ordered_json::parse(in, nullptr, true, true));
  } catch (const WrongModel& w) {
    wrong = file + ": error: " + w.text;
  } catch (const nlohmann::json::exception& e) {
    wrong = file + ": error: not JSON: " + e.what();
  }
  return std::nullopt;
}

std::string profile_json(const program::Program& program, const std::vector<vm::InstructionProfile>& spent,
                         std::uint64_t steps, const std::optional<CostModel>& model) {
  std::map<std::string, Sum> by_name;
  std::map<std::pair<std::uint32_t, std::uint32_t>, Sum> by_line;
  Sum all;
  ordered_json each = ordered_json::array();
  for (std::size_t at = 0; at < spent.size(); ++at) {
    if (spent[at].executions == 0) continue;
    const Sum sum = sum_of(program, at, spent[at], model);
    const program::SourceLocation& source = program.source_locations[program.code[at].source_location];
    all += sum;
    by_name[std::string(program::opcode_info(program.code[at].op).mnemonic)] += sum;
    by_line[{source.file, source.line}] += sum;
    ordered_json& one = each.emplace_back();
    one["index"] = at;
    one["instruction"] = program::opcode_info(program.code[at].op).mnemonic;
    one["file"] = program.files[source.file];
    one["line"] = source.line;
    sum.write(one, model.has_value());
  }
  ordered_json to;
  to["how"] = "one instruction at a time; without --profile instructions run together and faster";
  to["frames"] = steps;
  all.write(to["all"], model.has_value());
  if (model) to["estimate"] = estimate(all, steps, *model);
  for (const auto& [name, sum] : by_name) sum.write(to["instructions"][name], model.has_value());
  for (const auto& [place, sum] : by_line) {
    ordered_json& line = to["lines"].emplace_back();
    line["file"] = program.files[place.first];
    line["line"] = place.second;
    sum.write(line, model.has_value());
  }
  to["program"] = std::move(each);
  return to.dump(1) + "\n";
}

}  // namespace apron::run
