# Doxygen's input filter: our headers' plain comments, as the comments that Doxygen reads.
function documented(line) {  # a whole-line comment
  sub(/\/\/ ?/, "/// ", line)
  return line
}
FNR == 1 {
  if (/^\/\//) print "/// @file"
  if (/^\/\*/) { sub(/^\/\*/, "/** @file\n *"); print; next }
}
/---- .* ----/ { next }  # a heading between groups belongs to no name
/^[ \t]*\/\// { print documented($0); next }
/^[ \t]*\/\*[^*]/ { sub(/\/\*/, "/**"); print; next }
/[;,{}0-9A-Za-z_)] +\/\/ / { sub(/\/\/ /, "///< "); print; next }
/[;,0-9A-Za-z_)] +\/\* / && !/^[ \t]*#/ { sub(/\/\* /, "/**< "); print; next }
{ print }
