#include "smartsurf/run/cli/CommandLine.h"

int main(int argc, char** argv) { return smartsurf::run::main(argc, argv); }
