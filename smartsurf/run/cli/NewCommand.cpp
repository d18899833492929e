// `smartsurf new`: a small experiment and its program, to start from.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cerrno>
#include <filesystem>
#include <memory>

#include "common/process/ExitStatus.h"
#include "common/text/Printable.h"
#include "common/text/Words.h"
#include "smartsurf/run/OutputFile.h"
#include "smartsurf/run/cli/Subcommands.h"
#include "smartsurf/scene/SceneSpec.h"

namespace smartsurf::run {
namespace {

namespace fs = std::filesystem;

constexpr const char* kExperiment =
    R"(-- A table of pins, each with a sensor that measures the distance to the object above it.
-- docs/experiments.md describes every field.
local count = option('count', 4, 'number of balls')

surface { rows = 24, columns = 24,
          actuator = pin { range = {0, 3}, max_speed = 6, max_acceleration = 60 },
          sensors  = { proximity { range = 6 } },
          border   = { height = 3 } }

for i = 1, count do
  sphere { radius = 1.6, position = {random(4, 19), random(4, 19), 3 + 4 * i}, colour = 'orange', label = 'ball' }
end

-- How far east the balls are in the end, as a result of the run.
on_finish(function()
  local sum = 0
  for _, ball in ipairs(objects { label = 'ball' }) do sum = sum + (ball:position()) end
  metric('mean_x', sum / count)
end)
)";

constexpr const char* kProgram = R"(// Moves every ball east: the pins east of it go down, the others push it.
// Each cell computes the same, with its own values; docs/apron-language.md describes every instruction.
!register(BALL, POCKET)
while(1)
  BALL = surface.sense('proximity_hit')         // 1 where an object is above the pin, else 0
  POCKET = shift.east(BALL or shift.east(BALL)) // the image of the balls, moved one cell east
  surface.actuate('height', select(POCKET, 0, 0.8))
  surface.step                                  // publish, and wait for the next tick
endwhile
)";

int new_command(const std::string& name) {
  if (const fs::path last = fs::path(name).filename(); last.empty() || last == "." || last == "..")
    throw scene::InputError(fmt::format("new '{}': must be a name, not empty or a folder", name));
  const fs::path experiment = name + ".lua", program = name + ".aps";
  for (const fs::path& file : {experiment, program}) {
    if (fs::exists(file))
      throw scene::InputError(fmt::format("new {}: {} exists; choose another name", name, file.string()));
    require_writable("new", file.string());
  }
  replace_output_file("new", experiment.string(), kExperiment);
  replace_output_file("new", program.string(), kProgram);
  common::print_output(
      fmt::format("wrote {} and {}; run them with\n"
                  "  {} run {} --controller {} --until 10 --window\n",
                  experiment.string(), program.string(),
                  common::shell_word(program_invocation_name),  // as the user has called it
                  common::shell_word(experiment.string()), common::shell_word(program.string())));
  return common::kDone;
}

}  // namespace

CommandHandler add_new_command(CLI::App& app) {
  CLI::App* command = app.add_subcommand("new", "Write a small experiment and its program, to start from");
  const auto name = std::make_shared<std::string>();
  command->add_option("name", *name, "Writes NAME.lua and NAME.aps")->required()->type_name("NAME");
  return [name] { return new_command(*name); };
}

}  // namespace smartsurf::run
