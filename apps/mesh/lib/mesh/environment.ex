defmodule Mesh.Environment do
  @moduledoc """
  Checks the settings that a node takes from its environment, by the types of the same settings in a robot file
  (`Mesh.Options.file_table/0`). Pure but for `main/0`.

  | variable | |
  |---|---|
  | `CONVOY_FLEET` | `fleet`: names of robots, between commas or blanks |
  | `CONVOY_DIST_PORT` | `dist_port`: a TCP port |
  | `CONVOY_INTERFACE` | `interface`: an IPv4 address, or a network card |
  | `CONVOY_ALLOW` | `allow`: addresses and networks, between commas or blanks |
  | `CONVOY_UDP_PORT` | `port`: a UDP port, 0 for any |
  | `CONVOY_UDP_PEERS` | `peers`: addresses with ports, between commas or blanks |
  | `CONVOY_PEERS` | nodes with addresses: `mag2@convoy=10.0.0.12:9102` |
  | `CONVOY_TLS` | `0` or `1` |
  """
  alias Hal.Options.{Suggest, Type, Wording}
  alias Mesh.Distribution.Epmd.Peers
  alias Mesh.Options

  # What a person writes: `:number` and `:words` say how the text becomes a value.
  @settings [
    {"CONVOY_FLEET", :words, :fleet},
    {"CONVOY_DIST_PORT", :number, {:integer, 1, 65_535}},
    {"CONVOY_INTERFACE", :text, :interface},
    {"CONVOY_ALLOW", :words, :allow},
    {"CONVOY_UDP_PORT", :number, :port},
    {"CONVOY_UDP_PEERS", :words, :peers},
    {"CONVOY_PEERS", :words, :nodes},
    {"CONVOY_TLS", :text, {:one_of, ["0", "1"]}}
  ]

  # Checked by those that read them: names, paths, and what scripts tell each other.
  @others ~w(CONVOY_HOST CONVOY_NODE CONVOY_SECRET_FILE CONVOY_ROBOT_FILE CONVOY_ENV_FILE CONVOY_CERTS CONVOY_CERTS_DIR) ++
            ~w(CONVOY_RELEASE CONVOY_RES_OPTIONS)
  # Those of builds and tests.
  @development ~w(CONVOY_BUILD CONVOY_DEPS CONVOY_FAILED CONVOY_FROM CONVOY_MCAP CONVOY_PHOTOS CONVOY_PYTHON) ++
                 ~w(CONVOY_ROOTS CONVOY_RUN CONVOY_SKIPPED CONVOY_SOAK)
  @known for({name, _form, _type} <- @settings, do: name) ++ @others

  @doc """
  `:ok`, or what is wrong, a line each. An empty variable is one that is not set.

      iex> Mesh.Environment.check(%{"CONVOY_PEERS" => "mag2@convoy=10.0.0.12", "CONVOY_TLS" => ""})
      :ok
      iex> {:error, lines} = Mesh.Environment.check(%{"CONVOY_DIST_PORT" => "99999", "CONVOY_PEER" => "", "CONVOY_TLS" => "yes"})
      iex> lines
      ["CONVOY_DIST_PORT: expected a whole number from 1 to 65535, got 99999",
       "CONVOY_PEER is not known; did you mean CONVOY_PEERS?",
       "CONVOY_TLS: expected \\"0\\" or \\"1\\", got \\"yes\\""]
  """
  @spec check(%{optional(String.t()) => String.t()}) :: :ok | {:error, [line :: String.t(), ...]}
  def check(environment) do
    lines =
      for {"CONVOY_" <> _ = name, text} <- Enum.sort(environment),
          line <- wrong(name, text),
          do: line

    if lines == [], do: :ok, else: {:error, lines}
  end

  @doc "For scripts: says on standard error what is wrong in this environment, and ends with status 1."
  @spec main() :: :ok | no_return()
  def main do
    with {:error, lines} <- check(System.get_env()) do
      Enum.each(lines, &IO.puts(:stderr, "bin/node: " <> &1))
      System.halt(1)
    end
  end

  defp wrong(name, text) do
    case List.keyfind(@settings, name, 0) do
      {_name, _form, _type} when text == "" -> []
      {_name, form, type} -> value(name, form, type(type), text)
      nil when name in @others or name in @development -> []
      nil -> ["#{name} is not known#{hint(name)}"]
    end
  end

  # Only small letters are compared.
  defp hint(name) do
    case Suggest.nearest(name, Enum.map(@known, &String.downcase/1)) do
      nil -> ""
      near -> "; did you mean #{String.upcase(near)}?"
    end
  end

  defp type(:nodes),
    do: {:list, {:check, &node?/1, "node=address, as mag2@convoy=10.0.0.12:9102,"}, 1_000}

  defp type(key) when is_atom(key),
    do: Options.file_table() |> Keyword.fetch!(key) |> List.wrap() |> hd()

  defp type(type), do: type

  defp node?(text), do: match?([_peer], Peers.parse(text))

  defp value(name, form, type, text) do
    with {:ok, value} <- form(form, text),
         {:ok, _value} <- Type.read(type, value) do
      []
    else
      {:error, problems} -> for {_path, said} <- problems, do: "#{name}: #{said}"
      :error -> for {_path, said} <- elem(Wording.refuse(type, text), 1), do: "#{name}: #{said}"
    end
  end

  defp form(:text, text), do: {:ok, text}
  defp form(:words, text), do: {:ok, String.split(text, [",", " "], trim: true)}

  defp form(:number, text) do
    case Integer.parse(text) do
      {number, ""} -> {:ok, number}
      _other -> :error
    end
  end
end
