// `smartsurf demo`: the case study from the files that come with the program.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cstdlib>
#include <memory>

#include "common/files/Installation.h"
#include "common/text/Printable.h"
#include "smartsurf/run/cli/Subcommands.h"
#include "smartsurf/scene/SceneSpec.h"

namespace smartsurf::run {
namespace {

struct DemoFlags {
  std::string seed = "1";
  bool headless = false, close = false;
};

bool has_display() {
  for (const char* const variable : {"DISPLAY", "WAYLAND_DISPLAY"})
    if (const char* const value = std::getenv(variable); value != nullptr && *value != '\0') return true;
  return false;
}

std::vector<std::string> demo_arguments(const DemoFlags& flags) {
  const std::string folder = common::installed_file("case-study").string();
  if (folder.empty())
    throw scene::InputError(
        "demo: the case study is not installed beside this program (share/smartsurf/case-study)");
  std::vector<std::string> arguments = {"run",    folder + "/sort.lua", "--controller", folder + "/sort.aps",
                                        "--seed", flags.seed,           "--until",      "120"};
  const bool window = !flags.headless && has_display();
  if (window) arguments.insert(arguments.end(), {"--window", "--pace", "4"});
  if (window && flags.close) arguments.emplace_back("--close");
  std::string command = "smartsurf";
  for (const std::string& argument : arguments) command += " " + argument;
  common::print_output(
      fmt::format("Sorts 40 spheres by size{}. The same, to change:\n  {}\n",
                  window || flags.headless ? "" : ", without a window because DISPLAY is not set", command));
  return arguments;
}

}  // namespace

CommandHandler add_demo_command(CLI::App& app, std::function<int(const std::vector<std::string>&)> run) {
  CLI::App* command = app.add_subcommand(
      "demo", "Run the case study: sort 40 spheres by size, in a window if there is a display");
  const auto flags = std::make_shared<DemoFlags>();
  command->add_option("--seed", flags->seed, "Seed: where the spheres lie")
      ->check(whole_number_validator())
      ->type_name("N");
  command->add_flag("--headless", flags->headless, "Without a window");
  command->add_flag("--close", flags->close, "Close the windows at the end");
  return [flags, run = std::move(run)] { return run(demo_arguments(*flags)); };
}

}  // namespace smartsurf::run
