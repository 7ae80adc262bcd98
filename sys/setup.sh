#!/bin/sh
# Installs what the build of tison needs besides Rust: a C compiler, libclang (for bindgen) and Embree 4.
# It looks at what is there, never at the version of the system: one that took Embree from Debian 13 calls itself 13.
set -eu

usage() {
    cat <<'END'
Usage: sys/setup.sh [--check]

Installs with apt what `cargo build` of tison needs besides Rust: a C compiler, libclang and Embree 4.
When all of it is there already, nothing is touched and no rights are needed. Root's part is shown before
it is run, by sudo where you are not root.

On Debian 12, which has Embree 3 only, Embree 4 comes from Debian 13 (trixie), with the libraries that it
needs, libc6 among them. The files tison-trixie* in /etc/apt/sources.list.d and /etc/apt/preferences.d
make trixie known to apt, for these libraries and nothing else.

      --check    only say what is missing; exit status 1 when something is
  -h, --help     show this text
END
}

die() {
    echo "setup.sh: $*" >&2
    exit 1
}

# ---- What is there --------------------------------------------------------------------------------------------

# True when one of the paths exists. The callers pass glob patterns, which stay as they are when nothing fits.
any() {
    for path do
        [ ! -e "$path" ] || return 0
    done
    return 1
}

has_cc() {
    command -v cc >/dev/null && any /usr/include/stdio.h /usr/include/*/stdio.h
}

# Looks where bindgen looks. The library alone is not enough: without clang's own headers there is no <stddef.h>.
has_libclang() {
    [ ! -e "${LIBCLANG_PATH-}" ] || return 0
    for dir in /usr/lib* /usr/lib*/* /usr/lib*/*/* \
        /usr/local/lib* /usr/local/lib*/* /usr/local/lib*/*/* /usr/local/llvm*/lib*; do
        any "$dir"/libclang.so* "$dir"/libclang-[0-9]*.so* || continue
        ! any "$dir"/clang/*/include/stddef.h /usr/lib/clang/*/include/stddef.h || return 0
    done
    return 1
}

has_embree() {
    any /usr/include/embree4/rtcore.h /usr/local/include/embree4/rtcore.h &&
        any /usr/lib/libembree4.so /usr/lib64/libembree4.so /usr/lib/*/libembree4.so /usr/local/lib*/libembree4.so
}

# rustup puts cargo into the user's home, which sudo leaves out of the search path.
has_cargo() {
    ! command -v cargo >/dev/null || return 0
    home=${HOME-}
    [ -z "${SUDO_USER-}" ] || home=$(getent passwd "$SUDO_USER" | cut -d: -f6)
    [ -x "$home/.cargo/bin/cargo" ]
}

# Sets `missing`, words for people, and `packages`, apt's names for all of it but Embree.
look() {
    missing='' packages=''
    has_cc || { missing='a C compiler with the headers of libc' packages='gcc libc6-dev'; }
    has_libclang || {
        missing="${missing:+$missing, }libclang with its headers"
        packages="${packages:+$packages }libclang-dev"
    }
    has_embree || missing="${missing:+$missing, }Embree 4 with its headers"
}

# ---- What apt offers ------------------------------------------------------------------------------------------

# The version of libembree-dev that apt would install; empty when it knows of none.
candidate() {
    LC_ALL=C apt-cache policy libembree-dev 2>/dev/null | sed -n 's/^  Candidate: \([0-9].*\)/\1/p'
}

# How and where apt's sources name Debian's archive of codename $1, as `suite file`; empty when they do not.
# shellcheck disable=SC2016 # $(…) is apt's own notation
source_of() {
    apt-get indextargets --format '$(ORIGIN) $(COMPONENT) $(CODENAME) $(RELEASE) $(SOURCESENTRY)' \
        'Created-By: Packages' 2>/dev/null |
        sed -n "s/^Debian main $1 \([^ ]*\) \(.*\):[0-9]*\$/\1 \2/p" | head -n 1
}

# Prints the entry of file $2 for suite $1 again, for suite $3, with the same mirror, keyring and other options.
repeat_source() {
    case $2 in
    *.sources)
        awk -v old="$1" -v new="$3" -v RS= -F '\n' '
            {
                kept = ""; deb = suite = main = 0; on = 1
                for (i = 1; i <= NF; i++) {
                    if ($i ~ /^#/) continue
                    value = $i
                    if ($i !~ /^[ \t]/) {
                        field = tolower($i)
                        sub(/[ \t]*:.*/, "", field)
                        sub(/^[^:]*:/, "", value)
                    }
                    gsub(/[ \t]+/, " ", value)
                    value = " " value " "
                    if (field == "types") { if (value ~ / deb /) deb = 1 }
                    else if (field == "suites") { if (index(value, " " old " ")) suite = 1 }
                    else if (field == "components") { if (value ~ / main /) main = 1 }
                    else if (field == "enabled") { if (value ~ / (no|false|without|off|disable) /) on = 0 }
                    else kept = kept $i "\n"
                }
                if (deb && suite && main && on) {
                    printf "Types: deb\nSuites: %s\nComponents: main\n%s", new, kept
                    exit
                }
            }' "$2"
        ;;
    *)
        sed -E -n "s|^\s*(deb\s+(\[[^]]*\]\s*)?[^ \t#]+)\s+$1\s.*\bmain\b.*|\1 $3 main|p" "$2" | head -n 1
        ;;
    esac
}

# Prints the command that makes trixie known for the source of codename $1; $2 is its name in trixie.
add_source() {
    entry=$(source_of "$1")
    [ -n "$entry" ] || return 1
    file=${entry#* }
    lines=$(repeat_source "${entry%% *}" "$file" "$2")
    [ -n "$lines" ] || return 1
    printf "cat >/etc/apt/sources.list.d/tison-%s.%s <<'END'\n" "$2" "${file##*.}"
    printf '# For Embree 4; added by setup.sh of tison.\n%s\nEND\n' "$lines"
}

# Prints the commands that let apt take Embree from trixie on a bookworm system, and little else.
# Trixie's security updates come along, because Embree brings trixie's libc6.
add_trixie() {
    if [ -z "$(source_of trixie)" ]; then
        add_source bookworm trixie || return 1
        add_source bookworm-security trixie-security || :
    fi
    cat <<'COMMANDS'
cat >/etc/apt/preferences.d/tison-trixie <<'END'
Explanation: For Embree 4; added by setup.sh of tison. At this priority apt takes from trixie only what is asked
Explanation: for with -t trixie, and updates of what came from there.
Package: *
Pin: release n=trixie*
Pin-Priority: 100

Explanation: The libraries that come with Embree, and what has to be of one version with them: without this,
Explanation: build-essential, locales or valgrind could no longer be installed.
Package: src:glibc:any src:gcc-14:any src:onetbb:any src:hwloc:any src:level-zero:any dpkg-dev libdpkg-perl
Pin: release n=trixie*
Pin-Priority: 500
END
apt-get update -q || :
COMMANDS
}

# Prints what root has to run after `apt-get update`; fails when apt cannot provide Embree 4.
commands() {
    install='apt-get install -q -y --no-install-recommends --no-remove -o DPkg::Lock::Timeout=120'
    plain=$packages
    if ! has_embree; then
        case $(candidate) in
        4.*) plain="${plain:+$plain }libembree-dev" ;;
        *)
            add_trixie || return 1
            echo "$install -t trixie libembree-dev"
            ;;
        esac
    fi
    [ -z "$plain" ] || echo "$install $plain"
}

# ---- What to do -----------------------------------------------------------------------------------------------

check=false
for option do
    case $option in
    --check) check=true ;;
    -h | --help)
        usage
        exit
        ;;
    *)
        echo "setup.sh: unknown option '$option' (see --help)" >&2
        exit 2
        ;;
    esac
done

# Rust is the user's own: it is asked for at the end, when the rest is there.
finish() {
    has_cargo || die 'cargo is missing: install Rust from https://rustup.rs, which needs no root.'
    echo "$1"
    exit
}

look
if [ "$check" = true ]; then
    has_cargo || missing="${missing:+$missing, }cargo (see https://rustup.rs)"
    [ -z "$missing" ] || { echo "Missing: $missing."; exit 1; }
fi
[ -n "$missing" ] || finish 'All that the build of tison needs is there.'

without='build without Embree (cargo build --no-default-features), which needs none of it'
command -v apt-get >/dev/null ||
    die "no apt here: install a C compiler, libclang and Embree 4 with its headers your own way, or $without."

# apt asks no questions, and files of /etc that were changed by hand stay as they are.
quietly='env DEBIAN_FRONTEND=noninteractive NEEDRESTART_SUSPEND=1 DPKG_FORCE=security-mac,downgrade,confdef,confold'
sudo=''
if [ "$(id -u)" != 0 ]; then
    if command -v sudo >/dev/null; then
        sudo='sudo'
    else
        {
            echo "Missing: $missing. Installing it needs root; run this script as root, or these commands:"
            echo
            echo 'apt-get update -q'
            commands || echo '# then setup.sh once more: apt does not know yet where to take Embree 4 from'
        } >&2
        exit 1
    fi
fi

echo "Missing: $missing. Bringing apt's lists up to date${sudo:+, with sudo} ..."
# A list that cannot be had may not matter here; if it does, the next step says so.
# shellcheck disable=SC2086
$sudo $quietly apt-get update -q || echo 'setup.sh: apt-get update failed; going on with the old lists.' >&2

offer=$(candidate)
plan=$(commands) ||
    die "apt offers no Embree 4 here, but ${offer:-none}; install it from \
https://github.com/RenderKit/embree/releases, or $without."
case $plan in
*trixie*) echo "apt offers Embree ${offer:-none} here, so Embree 4 is taken from Debian 13 (trixie)." ;;
esac
printf '\nRunning as root:\n\n%s\n\n' "$plan"
# shellcheck disable=SC2086
$sudo $quietly sh -euc "$plan" || die 'the commands above did not succeed; it is safe to run this script again.
If apt stopped because it would have to remove packages and you agree to it, run its command without --no-remove first.'

look
[ -z "$missing" ] || die "still missing: $missing."
finish 'All that the build of tison needs is there now.'
