defmodule Swarm.Replacement.Order do
  @moduledoc false
  # Encodes the order that replaces a mission, as bytes, with its signature. Pure.
  #
  # Its content is the same for all robots that it is meant for: an identity, its sender, its receivers, the mission with its
  # options. Names are text: no byte of it becomes an atom, but what the build knows.
  #
  # The signature (`Mesh.sign/2`) is an HMAC-SHA256, by a key derived from the fleet's secret, over the robot's name, the stamp that this
  # robot has given for this order (`Swarm.Order.Freshness`), and a digest of the content. So it is good for one robot,
  # for half a second, and a robot takes one of each time.
  alias Hal.ExternalTerm
  alias Swarm.Order.Freshness
  alias Swarm.Wire

  @label "convoy replacement 1"
  @most_bytes 131_072
  # What it takes in memory, unpacked; and so its options alone.
  @most_memory 1_000_000
  @most_options 65_536
  @most_name 255

  @enforce_keys [:id, :from, :to, :mission, :options]
  defstruct @enforce_keys

  @typedoc "`options` are encoded (`options/1`)."
  @type t :: %__MODULE__{
          id: binary(),
          from: String.t(),
          to: [String.t()],
          mission: String.t(),
          options: binary()
        }

  @typedoc "The stamp of the order, or the time on the same node (`Swarm.Commands.Client`)."
  @type stamp :: Freshness.stamp() | {:asked, integer()}

  @doc "The label under which the key of the signature is derived."
  @spec label() :: String.t()
  def label, do: @label

  @doc "The most bytes that an order may have."
  @spec most_bytes() :: pos_integer()
  def most_bytes, do: @most_bytes

  @doc "The order as bytes; the error is one line that says how large it is."
  @spec encode(t()) :: {:ok, binary()} | {:error, line :: String.t()}
  def encode(%__MODULE__{} = order) do
    term = {2, order.id, order.from, order.to, order.mission, order.options}
    content = :erlang.term_to_binary(term, [:compressed])

    if ExternalTerm.bounded?(order.options, @most_options) and byte_size(content) <= @most_bytes and
         ExternalTerm.decodable?(term, @most_memory),
       do: {:ok, content},
       else:
         {:error,
          "options: expected data of at most #{div(@most_options, 1024)} kB, without processes and functions"}
  end

  @doc "The order of bytes whose signature was checked; `:error` for anything else."
  @spec decode(binary()) :: {:ok, t()} | :error
  def decode(content) do
    with {:ok, {2, <<_::128>> = id, from, to, mission, options}} <-
           ExternalTerm.decode(content, @most_memory),
         true <- name?(from) and name?(mission) and is_binary(options),
         true <- Wire.list?(to, &name?/1) do
      {:ok, %__MODULE__{id: id, from: from, to: to, mission: mission, options: options}}
    else
      _other -> :error
    end
  end

  @doc "Options as an order carries them."
  @spec encode_options(keyword()) :: binary()
  def encode_options(options), do: :erlang.term_to_binary(options)

  @doc "The options of an order; `:error` if they name what this node does not know."
  @spec options(t()) :: {:ok, keyword()} | :error
  def options(%__MODULE__{options: encoded}) do
    with {:ok, options} <- ExternalTerm.decode(encoded, @most_options),
         true <- Keyword.keyword?(options),
         do: {:ok, options},
         else: (_no -> :error)
  end

  defp name?(text), do: is_binary(text) and byte_size(text) in 1..@most_name

  @doc "The bytes that are signed: this content, for this robot, at this time."
  @spec signed_bytes(robot :: atom(), stamp(), content :: binary()) :: binary()
  def signed_bytes(robot, {life, at_us}, content),
    do: "#{robot}\0#{life}\0#{at_us}\0" <> :crypto.hash(:sha256, content)

  @doc "Whether a term from outside is this signature; it takes equally long whichever byte differs."
  @spec same?(<<_::256>>, term()) :: boolean()
  def same?(mac, given),
    do: is_binary(given) and byte_size(given) == 32 and :crypto.hash_equals(mac, given)

  @doc """
  A module's name for people.

      iex> Swarm.Replacement.Order.name("Elixir.Ours.Gather")
      "Ours.Gather"
  """
  @spec name(String.t()) :: String.t()
  def name("Elixir." <> name), do: name
  def name(name), do: name
end
