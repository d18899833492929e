// The messages of command-line errors, for programs with subcommands. Includes no CLI11 header.
#pragma once

#include <string>

namespace CLI {
class App;
class ParseError;
}  // namespace CLI

namespace common {

// One line for an error of app.parse(argc, argv): what is wrong, the flag or command that was probably meant,
// and the help page of the command that was typed:
//   unknown flag '--untill'; did you mean '--until'? (see smartsurf run --help)
std::string describe_parse_error(const CLI::App& app, const CLI::ParseError& error, int argc,
                                 const char* const* argv);

}  // namespace common
