defmodule Mesh.Secret do
  @moduledoc """
  Holds the single secret of a fleet. Every robot has the same small file; a node that has it belongs to the fleet.

  Two things are derived from it, neither of which reveals the other or the secret: the key that
  signs datagrams, and the cookie of Erlang's distribution. There is no default: a node without a
  good secret does not start its mesh, and says in one line what to do.

  The file is text, base64 or hex, of at least 32 random bytes, for its owner alone (mode 0600):

      mix fleet.secret                                                  # where the project is
      (umask 077; head -c 32 /dev/urandom | base64 > /etc/convoy/secret)   # on a robot

  Its path is `CONVOY_SECRET_FILE`, else `convoy.secret` in the current folder; a release looks in
  `/etc/convoy/secret`. The struct shows neither key nor cookie when inspected: keep it whole in
  the state of processes, and take the key out only where it is used. The fingerprint may be
  shown: robots with the same one have the same secret.
  """
  alias Mesh.Secret

  @derive {Inspect, only: [:path, :fingerprint]}
  @enforce_keys [:path, :key, :cookie, :fingerprint]
  defstruct @enforce_keys

  @type t :: %__MODULE__{
          path: Path.t(),
          key: <<_::256>>,
          cookie: atom(),
          fingerprint: String.t()
        }

  @default "convoy.secret"

  @doc "The default path of the secret."
  @spec default_path() :: Path.t()
  def default_path, do: @default

  @doc """
  Reads a secret file. The line of an error names the file, what is wrong with it, and the command
  that makes a good one.

      iex> {:error, line} = Mesh.Secret.load("/nowhere/secret")
      iex> line
      "the fleet's secret /nowhere/secret does not exist; make one: mix fleet.secret /nowhere/secret"
  """
  @spec load(Path.t()) :: {:ok, t()} | {:error, line :: String.t()}
  def load(path) when is_binary(path) do
    with {:ok, text} <- Secret.File.read(path),
         {:ok, bytes} <- Secret.Text.decode(text) do
      {:ok, derive(path, bytes)}
    else
      {:error, problem} -> {:error, line(path, problem)}
    end
  end

  @doc "Reads the secret that the environment names: `CONVOY_SECRET_FILE`, else `convoy.secret` here."
  @spec from_env(%{optional(String.t()) => String.t()}) ::
          {:ok, t()} | {:error, line :: String.t()}
  def from_env(environment \\ System.get_env()) do
    case Map.get(environment, "CONVOY_SECRET_FILE", "") do
      "" -> load(@default)
      path -> load(path)
    end
  end

  @doc """
  Makes a secret file of 32 random bytes, and missing folders above it. An existing file stays,
  unless forced.
  """
  @spec create(Path.t(), force? :: boolean()) :: {:ok, t()} | {:error, line :: String.t()}
  def create(path, force? \\ false) do
    text = text()

    case Secret.File.write(path, text <> "\n", force?) do
      :ok -> load(path)
      {:error, problem} -> {:error, "the fleet's secret #{shown(path)} #{problem}"}
    end
  end

  @doc """
  A secret that is in no file, for a fleet that lives no longer than the process that started it.

      iex> Mesh.Secret.random().fingerprint == Mesh.Secret.random().fingerprint
      false
  """
  @spec random() :: t()
  def random, do: derive("", :crypto.strong_rand_bytes(32))

  @doc """
  A key of 32 bytes for one more purpose, which reveals neither the secret nor another key. `label` names the
  purpose and its version.

      iex> secret = Mesh.Secret.random()
      iex> {byte_size(Mesh.Secret.subkey(secret, "a 1")), Mesh.Secret.subkey(secret, "a 1") == secret.key}
      {32, false}
  """
  @spec subkey(t(), label :: String.t()) :: <<_::256>>
  def subkey(%Secret{key: key}, label), do: hmac(key, label)

  @doc """
  Gives this node the fleet's cookie, whatever cookie it was started with. If it was another one,
  all connected nodes are disconnected, because they connected with a cookie that is not ours.
  """
  @spec apply_cookie(t()) :: :ok | {:error, line :: String.t()}
  def apply_cookie(%Secret{cookie: cookie}) do
    cond do
      not Node.alive?() ->
        {:error, "this node has no name; start it with one (--name mag1@HOST, or ROBOT=mag1)"}

      Node.get_cookie() == cookie ->
        :ok

      true ->
        Node.set_cookie(cookie)
        Enum.each(Node.list(:connected), &Node.disconnect/1)
    end
  end

  @doc """
  The command that makes a good secret there. Without Mix, as in a release, it uses programs that
  every system has.

      iex> Mesh.Secret.command("/etc/secret", false, false)
      "(umask 077; head -c 32 /dev/urandom | base64 > /etc/secret)"
  """
  @spec command(Path.t(), mix? :: boolean(), there? :: boolean()) :: String.t()
  def command(path, mix?, there?)
  def command(path, true, false), do: "mix fleet.secret #{shell(path)}"
  def command(path, true, true), do: "mix fleet.secret #{shell(path)} --force"
  def command(path, false, true), do: "rm #{shell(path)}; #{command(path, false, false)}"

  def command(path, false, false) do
    folder = Path.dirname(path)
    mkdir = if File.dir?(folder), do: "", else: "mkdir -p #{shell(folder)}; "
    "(umask 077; #{mkdir}head -c 32 /dev/urandom | base64 > #{shell(path)})"
  end

  defp line(path, "may be read by others" <> _rest = problem),
    do: "the fleet's secret #{shown(path)} #{problem}; close it: chmod 600 #{shell(path)}"

  # A user who may not read it should not replace it.
  defp line(path, "cannot be read (permission denied)" = problem),
    do: "the fleet's secret #{shown(path)} #{problem}; do this as root, or as its owner"

  defp line(path, problem) do
    command = command(path, Code.ensure_loaded?(Mix), problem != "does not exist")
    "the fleet's secret #{shown(path)} #{problem}; make one: #{command}"
  end

  # A random one may look weak, about one in a hundred thousand.
  defp text do
    text = Base.encode64(:crypto.strong_rand_bytes(32))
    if match?({:ok, _bytes}, Secret.Text.decode(text)), do: text, else: text()
  end

  # The only atom that is made from text, from a file of this node's owner.
  defp derive(path, bytes) do
    cookie = bytes |> hmac("convoy cookie 1") |> Base.encode32(case: :lower, padding: false)

    %Secret{
      path: path,
      key: hmac(bytes, "convoy datagrams 1"),
      cookie: String.to_atom(cookie),
      fingerprint: bytes |> hmac("convoy fingerprint 1") |> binary_part(0, 4) |> Base.encode16()
    }
  end

  defp hmac(bytes, label), do: :crypto.mac(:hmac, :sha256, bytes, label)

  # Quoted so that a shell takes it as one word.
  defp shell(path) do
    if String.match?(path, ~r/\A[\w.,\/:@%+=-]+\z/),
      do: path,
      else: "'" <> String.replace(shown(path), "'", "'\\''") <> "'"
  end

  # One line, whatever the name contains.
  defp shown(path),
    do:
      if(String.printable?(path) and not (path =~ ~r/[[:cntrl:]]/), do: path, else: inspect(path))
end
