#include "common/cli/ParseErrors.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <string_view>
#include <vector>

#include "common/files/FileKind.h"
#include "common/text/Suggestion.h"

namespace common {
namespace {

std::vector<const CLI::App*> all_commands(const CLI::App& app) {
  return app.get_subcommands([](const CLI::App*) { return true; });
}

// The command that takes such a file, in either program.
std::string command_for(std::string_view file, const std::string& otherwise) {
  switch (file_kind(std::filesystem::path(file))) {
    case FileKind::kExperiment:
      return "smartsurf run";
    case FileKind::kProgram:
      return "apron run";
    case FileKind::kRecording:
      return "smartsurf replay";
    default:
      return otherwise;
  }
}

// "no command 'fly'; known: run, check". Empty if the first argument is a command, or a flag of the program.
std::string describe_unknown_command(const CLI::App& app, std::string_view name) {
  std::vector<std::string> known;
  for (const CLI::App* command : all_commands(app)) known.push_back(command->get_name());
  if (name.starts_with('-') || std::ranges::find(known, name) != known.end()) return {};
  const std::string text = "no command '" + std::string(name) + "'";
  if (name.find_first_of("./") != std::string_view::npos)  // a file
    return text + "; the command comes first: " + command_for(name, app.get_name() + " " + known.front()) +
           " " + std::string(name);
  return text + did_you_mean(name, known) + "; known: " + CLI::detail::join(known, ", ");
}

std::string other_command_with(const CLI::App& app, const CLI::App& command, const std::string& flag) {
  for (const CLI::App* other : all_commands(app))
    if (other != &command && other->get_option_no_throw(flag) != nullptr)
      return "; it is a flag of " + app.get_name() + " " + other->get_name();
  return {};
}

std::string describe_unknown_argument(const CLI::App& app, const CLI::App& command) {
  std::vector<std::string> extras = command.remaining();
  const auto flag =
      std::ranges::find_if(extras, [](const std::string& text) { return text.starts_with('-'); });
  if (flag == extras.end()) return "unexpected argument '" + extras.front() + "'";
  const std::string name = flag->substr(0, flag->find('='));
  // Compared without the dashes, of which the suggestion allows fewer edits.
  std::vector<std::string> known;
  for (const CLI::Option* option : command.get_options())
    for (const std::string& word : option->get_lnames()) known.push_back(word);
  const std::string nearest = nearest_name(name.substr(name.find_first_not_of('-') % name.size()), known);
  const std::string text = "unknown flag '" + name + "'";
  const std::string elsewhere = other_command_with(app, command, name);
  if (!elsewhere.empty()) return text + elsewhere;
  return nearest.empty() ? text : text + "; did you mean '--" + nearest + "'?";
}

}  // namespace

void refuse_empty_values(CLI::App& app) {
  const auto refuse = [](const std::string& value) {
    return value.empty() ? std::string("must not be empty") : std::string();
  };
  for (CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; }))
    for (CLI::Option* option : command->get_options())
      if (option->nonpositional() && option->get_expected_min() > 0) option->check(refuse);
}

std::string describe_parse_error(const CLI::App& app, const CLI::ParseError& error, int argc,
                                 const char* const* argv) {
  const auto parsed = app.get_subcommands();
  const CLI::App& command = parsed.empty() ? app : *parsed.back();
  std::string text = argc > 1 ? describe_unknown_command(app, argv[1]) : std::string();
  // Without a command CLI11 reports its absence before a misspelt flag of the program.
  const bool has_extras = &command == &app || dynamic_cast<const CLI::ExtrasError*>(&error) != nullptr;
  if (text.empty() && has_extras && command.remaining_size() > 0)
    text = describe_unknown_argument(app, command);
  if (text.empty()) text = error.what();
  const std::string page = &command == &app ? app.get_name() : app.get_name() + " " + command.get_name();
  return text + " (see " + page + " --help)";
}

}  // namespace common
