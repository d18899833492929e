// The command-line errors of programs with subcommands, and their messages. Includes no CLI11 header.
#pragma once

#include <string>

namespace CLI {
class App;
class ParseError;
}  // namespace CLI

namespace common {

// Makes an empty value of any flag of the commands an error. Call it when all are added.
void refuse_empty_values(CLI::App& app);

// One line for an error of app.parse(argc, argv): what is wrong, the flag or command that was probably meant,
// and the help page of the command that was typed:
//   unknown flag '--untill'; did you mean '--until'? (see smartsurf run --help)
std::string describe_parse_error(const CLI::App& app, const CLI::ParseError& error, int argc,
                                 const char* const* argv);

}  // namespace common
