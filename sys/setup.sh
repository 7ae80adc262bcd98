#!/bin/sh
# Installs what the build of tison needs besides Rust: a C compiler, libclang (for bindgen) and Embree 4.
# It looks at what is there, never at the name of the system. See --help.
set -eu

usage() {
    cat <<'END'
Usage: sys/setup.sh [--check]

Installs with apt what `cargo build` of tison needs besides Rust: a C compiler, libclang and Embree 4.
When all of it is there already, nothing is touched and no rights are needed.

On Debian 12, which has Embree 3 only, Embree 4 comes from Debian 13 (trixie): a source with the mirror
of this system is added to /etc/apt at a priority so low that nothing else is ever taken from it.

      --check    only say what is missing; exit status 1 when something is
  -h, --help     show this text
END
}

die() {
    echo "setup.sh: $*" >&2
    exit 1
}

# ---- What is there ------------------------------------------------------------------------------------------

# True when any of the given paths exists; the callers pass glob patterns, which stay as they are when nothing fits.
any() {
    for path do
        [ ! -e "$path" ] || return 0
    done
    return 1
}

# The directories in which bindgen looks for libclang; the system's linker finds its libraries in a part of them.
libs='/usr/lib* /usr/lib*/* /usr/lib*/*/* /usr/local/lib* /usr/local/lib*/* /usr/local/lib*/*/* /usr/local/llvm*/lib*'

has_cc() {
    command -v cc >/dev/null && any /usr/include/stdio.h /usr/include/*/stdio.h
}

# The library alone is not enough: without clang's own headers bindgen does not find <stddef.h>.
has_libclang() {
    for dir in ${LIBCLANG_PATH-$libs}; do
        for lib in "$dir"/libclang.so "$dir"/libclang.so.* "$dir"/libclang-[0-9]*.so "$dir"/libclang-[0-9]*.so.*; do
            [ -e "$lib" ] || continue
            [ -z "${LIBCLANG_PATH-}" ] || return 0
            any "$dir"/clang/*/include/stddef.h && return 0
        done
    done
    return 1
}

has_embree() {
    any /usr/include/embree4/rtcore.h /usr/local/include/embree4/rtcore.h || return 1
    any /usr/lib/libembree4.so /usr/lib64/libembree4.so /usr/lib/*/libembree4.so /usr/local/lib*/libembree4.so
}

# rustup puts cargo into the home of the user, which sudo takes from the search path.
has_cargo() {
    command -v cargo >/dev/null && return 0
    home=${HOME-}
    [ -z "${SUDO_USER-}" ] || home=$(getent passwd "$SUDO_USER" | cut -d: -f6)
    [ -x "$home/.cargo/bin/cargo" ]
}

# Sets `missing`, a list for people, and `packages`, the names that apt has for all of it but Embree.
look() {
    missing='' packages=''
    has_cc || { missing="a C compiler with libc's headers" packages='gcc libc6-dev'; }
    has_libclang || { missing="${missing:+$missing, }libclang with its headers" packages="$packages libclang-dev"; }
    has_embree || missing="${missing:+$missing, }Embree 4 with its headers"
}

# ---- What apt offers ----------------------------------------------------------------------------------------

# The version of libembree-dev that apt would install; empty when it knows of none.
candidate() {
    LC_ALL=C apt-cache "$@" policy libembree-dev 2>/dev/null | sed -n 's/^  Candidate: \([0-9].*\)/\1/p'
}

# Where apt has Debian's own main archive of the codename $1 from, as `suite file`; empty when it does not.
source_of() {
    apt-get indextargets --format '$(ORIGIN) $(COMPONENT) $(CODENAME) $(RELEASE) $(SOURCESENTRY)' \
        'Created-By: Packages' 2>/dev/null |
        sed -n "s/^Debian main $1 \([^ ]*\) \(.*\):[0-9]*\$/\1 \2/p" | head -n 1
}

# Repeats the entry of file $2 that offers suite $1, for suite $3 and with all its other options.
repeat_source() {
    case $2 in
    *.sources)
        awk -v old="$1" -v new="$3" -v RS= -F '\n' '
            {
                out = ""; deb = suite = main = 0; off = 0
                for (i = 1; i <= NF; i++) {
                    if ($i ~ /^#/) continue
                    if ($i ~ /^[^ \t]/) { field = tolower($i); sub(/[ \t]*:.*/, "", field) }
                    value = $i
                    if ($i ~ /^[^ \t]/) sub(/^[^:]*:/, "", value)
                    words = " " value " "; gsub(/[ \t]+/, " ", words)
                    if (field == "types") { if (words ~ / deb /) deb = 1 }
                    else if (field == "suites") { if (index(words, " " old " ")) suite = 1 }
                    else if (field == "components") { if (words ~ / main /) main = 1 }
                    else if (field == "enabled") { if (words ~ / (no|false|0|off) /) off = 1 }
                    else out = out $i "\n"
                }
                if (deb && suite && main && !off) {
                    printf "Types: deb\nSuites: %s\nComponents: main\n%s", new, out
                    exit
                }
            }' "$2"
        ;;
    *)
        sed -n "s/^[[:space:]]*\(deb[[:space:]]\{1,\}\(\[[^]]*\][[:space:]]*\)\{0,1\}[^[:space:]]\{1,\}\)[[:space:]]\{1,\}$1[[:space:]].*main.*/\1 $3 main/p" "$2" | head -n 1
        ;;
    esac
}

# Prints the commands that add trixie as a source for Embree and nothing else. Its security updates come along,
# because Embree brings trixie's libc6 with it.
add_trixie() {
    found=''
    for part in '' -security; do
        entry=$(source_of "bookworm$part")
        [ -n "$entry" ] || continue
        suite=${entry%% *} file=${entry#* }
        lines=$(repeat_source "$suite" "$file" "trixie$part")
        [ -n "$lines" ] || continue
        kind=list
        [ "$file" = "${file%.sources}" ] || kind=sources
        redirect='>'
        case $found in *" $kind "*) redirect='>>' ;; esac
        found="$found $kind "
        printf "cat %s/etc/apt/sources.list.d/tison-trixie.%s <<'END'\n" "$redirect" "$kind"
        printf '# For Embree 4, added by setup.sh of tison.\n%s\n\nEND\n' "$lines"
    done
    cat <<'COMMANDS'
cat >/etc/apt/preferences.d/tison-trixie <<'END'
Explanation: Trixie is there for Embree 4 alone (added by setup.sh of tison). At priority 100 apt takes from it
Explanation: only what is asked for with -t trixie, and updates of what came from it.
Package: *
Pin: release n=trixie
Pin-Priority: 100

Package: *
Pin: release n=trixie-security
Pin-Priority: 100
END
apt-get update -q
COMMANDS
}

# Prints the commands that install what is missing, to be run by root; fails with a reason on stderr when apt
# cannot provide it.
commands() {
    install='apt-get install -q -y --no-install-recommends -o DPkg::Lock::Timeout=120'
    from_trixie=''
    if [ -n "$packages" ]; then
        # A system that has trixie's libc6 may lack the libc6-dev that fits it: then all comes from there.
        # shellcheck disable=SC2086
        if [ -n "$(source_of trixie)" ] && ! apt-get install -s --no-install-recommends $packages >/dev/null 2>&1; then
            from_trixie=$packages
        else
            printf '%s%s\n' "$install " "${packages# }"
        fi
    fi
    if ! has_embree; then
        case $(candidate) in
        4.*) echo "$install libembree-dev" ;;
        *)
            case $(candidate -t trixie) in
            4.*) ;;
            *)
                [ -n "$(source_of bookworm)" ] || return 1
                add_trixie
                ;;
            esac
            from_trixie="${from_trixie# } libembree-dev"
            ;;
        esac
    fi
    [ -z "$from_trixie" ] || echo "$install -t trixie ${from_trixie# }"
}

# ---- What to do ---------------------------------------------------------------------------------------------

check=false
for option do
    case $option in
    --check) check=true ;;
    -h | --help) usage && exit ;;
    *)
        echo "setup.sh: unknown option '$option'; --help shows the known ones" >&2
        exit 2
        ;;
    esac
done

look
has_cargo || {
    rust='Rust is missing: install it with rustup, see https://rustup.rs'
    [ "$check" = true ] || die "$rust"
    missing="${missing:+$missing, }Rust (see https://rustup.rs)"
}
if [ -z "$missing" ]; then
    echo 'All that the build of tison needs is there.'
    exit
fi
[ "$check" = false ] || die "missing: $missing"

command -v apt-get >/dev/null || die "there is no apt here; install $missing by the means of this system \
(Embree: https://github.com/RenderKit/embree/releases), or build without: cargo build --no-default-features"

# No questions, and files of /etc that the user has changed stay as they are.
quiet='DEBIAN_FRONTEND=noninteractive NEEDRESTART_SUSPEND=1 DPKG_FORCE=security-mac,downgrade,confdef,confold'
as_root=env
if [ "$(id -u)" != 0 ]; then
    if command -v sudo >/dev/null; then
        as_root='sudo env'
    else
        {
            echo "Missing: $missing."
            echo 'This needs root, and there is no sudo. Run this script as root, or these commands:'
            echo
            echo 'apt-get update -q'
            commands || echo '# Run setup.sh again: apt does not know yet where to take Embree 4 from.'
        } >&2
        exit 1
    fi
fi

echo "Missing: $missing. First, apt's lists of packages are brought up to date."
# A list that cannot be fetched may be of no importance here; if it is, the next step fails and says why.
# shellcheck disable=SC2086
$as_root $quiet apt-get update -q || echo 'apt-get update failed; trying to go on.' >&2

offer=$(candidate)
plan=$(commands) || die "apt has no Embree 4 here (but ${offer:-none}); install it by hand from \
https://github.com/RenderKit/embree/releases, or build without: cargo build --no-default-features"
printf 'Now these commands are run as root:\n\n%s\n\n' "$plan"
# shellcheck disable=SC2086
$as_root $quiet sh -euc "$plan"

look
[ -z "$missing" ] || die "still missing: $missing"
echo 'All that the build of tison needs is there now.'
