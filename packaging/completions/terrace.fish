# Completion of terrace for fish. It reads `terrace COMMAND --help`, so it knows the options of the installed program.
function __terrace_commands
    terrace --help 2>/dev/null | sed -n '/^Commands:/,/^$/s/^  \([a-z]*\)  *\(.*\)/\1\t\2/p'
end
function __terrace_options
    set -l words (commandline -opc)
    set -l command $words[2]
    terrace $command --help 2>/dev/null | grep -oE '(^ +|,)--?[a-z][a-z-]*' | tr -d ' ,'
end
function __terrace_values
    # `--form chunks|folder|single`: the words between the bars
    set -l words (commandline -opc)
    string match -q -- "-*" $words[-1]; or return
    terrace $words[2] --help 2>/dev/null | sed -n "s/^ *\(-[a-z],\)\{0,1\}$words[-1] \([a-z0-9-]*|[a-z0-9|-]*\).*/\2/p" | tr '|' '\n'
end
complete -c terrace -n __fish_use_subcommand -f -a '(__terrace_commands)'
complete -c terrace -n 'string match -q -- "-*" (commandline -ct)' -f -a '(__terrace_options)'
complete -c terrace -n 'not __fish_use_subcommand' -a '(__terrace_values)'
