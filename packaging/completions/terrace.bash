# Completion of terrace for bash. It reads `terrace COMMAND --help`, so it knows the options of the installed program.
_terrace() {
  local word=${COMP_WORDS[COMP_CWORD]} previous=${COMP_WORDS[COMP_CWORD - 1]} command="" values help
  [[ $COMP_CWORD -gt 1 ]] && command=${COMP_WORDS[1]}
  help=$("${COMP_WORDS[0]}" $command --help 2> /dev/null) || return
  if [[ $COMP_CWORD -eq 1 && $word != -* ]]; then
    COMPREPLY=($(compgen -W "$(sed -n '/^Commands:/,/^$/s/^  \([a-z]*\) .*/\1/p' <<< "$help")" -- "$word"))
    return
  fi
  if [[ $word == -* ]]; then
    COMPREPLY=($(compgen -W "$(grep -oE '(^ +|,)--?[a-z][a-z-]*' <<< "$help" | tr -d ' ,')" -- "$word"))
    return
  fi
  # `--form chunks|folder|single`: the words between the bars; `--config FILE`: files.
  values=""
  [[ $previous == -* ]] && values=$(sed -n "s/^ *\(-[a-z],\)\?$previous \([a-z0-9-]*|[a-z0-9|-]*\).*/\2/p" <<< "$help" | tr '|' ' ')
  if [[ -n $values ]]; then COMPREPLY=($(compgen -W "$values" -- "$word")); else COMPREPLY=($(compgen -f -- "$word")); fi
}
complete -o filenames -F _terrace terrace
